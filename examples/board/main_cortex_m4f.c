/* The loop on a microcontroller: the timer's interrupt runs the period, and the log is sent while nothing else is to do. */
#include <stdint.h>

#include "control_task.h"
#include "log.h"
#include "mps2_board.h"

#define PERIODS 10000u /* of the emulation: ten seconds; on a robot the loop has no end */

void every_period(void);
int main(void);

static volatile uint32_t periods, fault, longest;

void every_period(void) {
  mps2_tick();
  fault = control_period();
  const uint32_t ticks = mps2_ticks();
  if (ticks > longest) longest = ticks;
  ++periods;
}

int main(void) {
  const int refused = control_start();
  if (refused != 0) {
    mps2_end((uint32_t)refused); /* the drive stays off */
    return refused;
  }
  mps2_start();
  while (periods < PERIODS) {
    (void)log_send();
    __asm volatile("wfi");
  }
  while (!log_send()) {
  }
  mps2_end(log_lost() != 0 ? 100u : fault);
  return 0;
}
