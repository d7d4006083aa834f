// The precompiled header of the tests: what most of them include. Each test still includes what it needs.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "core/contract/registry.hpp"
#include "core/topology/builders.hpp"
#include "tests/conformance/check.hpp"
#include "tests/support/synthetic_scenes.hpp"
