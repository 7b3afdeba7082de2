#include "reports/command_line/cli.h"

int main(int argc, char** argv) { return metastable::reports::run(argc, argv); }
