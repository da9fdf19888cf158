/* The emulated board besides what board.h asks for. */
#ifndef MPS2_BOARD_H
#define MPS2_BOARD_H

#include <stdint.h>

/* Timer and serial line on; the timer interrupts every period. */
void mps2_start(void);

/* From the timer's interrupt: the clock goes on by a period. */
void mps2_tick(void);

/* Ticks of the timer since the period began, of MPS2_TICKS in a period. */
uint32_t mps2_ticks(void);
#define MPS2_TICKS 25000u

/* Ends the emulation; a real board has nothing to end. */
void mps2_end(uint32_t status);

#endif
