// Owns the precompiled header. A program, because it has to be compiled with the flags of programs.
int main() {}
