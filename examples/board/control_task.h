/* One period: read, step, drive, log. */
#ifndef CONTROL_TASK_H
#define CONTROL_TASK_H

#include <stdint.h>

/* Once at power-on. Returns 0, or the pellucid_fault for which the drive stays off. */
int control_start(void);

/* Once a period. Returns the fault, 0 while all is well. */
uint32_t control_period(void);

#endif
