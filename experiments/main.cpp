#include "experiments/cli/program.hpp"

int main(int argc, char** argv) {
  return kbvh::experiments::run_program(argc, argv);
}
