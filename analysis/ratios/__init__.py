"""What times are compared with, and what follows: ratios, profiles, limits, ageing, choices, robustness."""
