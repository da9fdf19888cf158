/* What the loop needs of a board. Two boards here: an emulated Cortex-M4F and a computer with Linux; write the third. */
#ifndef BOARD_H
#define BOARD_H

#include <stdint.h>

#define PERIOD_US 1000

/* What was measured at the beginning of a period. Each value has been measured `age_us` before `now`. */
typedef struct board_reading {
  float position;      /* of the joint [rad or m] */
  float drive;         /* what the drive measures of its own effort, at the joint [N*m or N] */
  int64_t age_us;      /* of both */
  uint32_t is_valid;   /* 0: the encoder says that this is no measurement */
} board_reading;

/* Whole microseconds of one clock that only goes on. */
int64_t board_now_us(void);

/* Reads encoder and drive. Here: a virtual joint, virtual_joint.c. */
board_reading board_read(void);

/* Gives the drive its command, and switches the power stage. Here: the same virtual joint. */
void board_drive(float effort, uint32_t enable);

/* Sends a byte of the log; 0 where the line has no room for it now. Never waits. */
int board_send(char byte);

#endif
