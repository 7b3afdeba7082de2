#include "reports/output/interrupt.h"

#include <gtest/gtest.h>

#include <csignal>

namespace metastable::reports {
namespace {

TEST(Interrupt, NothingHappensWithoutASignal) { EXPECT_NO_THROW(check_interrupt()); }

TEST(Interrupt, ASignalBecomesAnExceptionWithItsExitCode) {
  for (const auto& [signal, code] : {std::pair{SIGINT, 130}, std::pair{SIGTERM, 143}}) {
    catch_interrupts();
    std::raise(signal);
    try {
      check_interrupt();
      ADD_FAILURE() << "not thrown";
    } catch (const Interrupted& interrupted) {
      EXPECT_EQ(interrupted.exit_code(), code);
    }
    clear_interrupt();
    EXPECT_NO_THROW(check_interrupt());
  }
}

TEST(InterruptDeathTest, TheSecondSignalEndsTheProgram) {
  EXPECT_EXIT(
      {
        catch_interrupts();
        std::raise(SIGINT);
        std::raise(SIGINT);
      },
      testing::KilledBySignal(SIGINT), "");
}

}  // namespace
}  // namespace metastable::reports
