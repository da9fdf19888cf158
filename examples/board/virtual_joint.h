/* A joint that somebody moves, in place of encoder and drive, so that the example runs without a robot. */
#ifndef VIRTUAL_JOINT_H
#define VIRTUAL_JOINT_H

#include "board.h"

/* The joint at a time, after the efforts that it has been given until then. */
board_reading virtual_joint_read(int64_t now_us);

/* What the drive gives from now on; without power it gives nothing. */
void virtual_joint_drive(float effort, uint32_t enable);

#endif
