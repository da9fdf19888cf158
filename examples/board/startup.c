/* What a Cortex-M4F needs before main: the vector table, data and zeros in their places, the floating-point unit on. */
#include <stdint.h>

extern uint32_t stack_top, data_load, data_start, data_end, bss_start, bss_end;

int main(void);
void every_period(void); /* the interrupt of the system's timer */
void reset(void);
void stand_still(void);

/* A fault of the processor: the drive's own watchdog takes the power off, since the heartbeat is gone. */
void stand_still(void) {
  for (;;) {
  }
}

void reset(void) {
  *(volatile uint32_t*)0xE000ED88u |= 0xFu << 20; /* access to the floating-point unit */
  __asm volatile("dsb\n isb" ::: "memory");
  for (uint32_t *from = &data_load, *to = &data_start; to < &data_end;) *to++ = *from++;
  for (uint32_t* word = &bss_start; word < &bss_end;) *word++ = 0;
  (void)main();
  stand_still();
}

typedef struct vector_table {
  uint32_t* stack;
  void (*handler[15])(void);
} vector_table;

__attribute__((section(".vectors"), used)) static const vector_table vectors = {
    &stack_top,
    {reset, stand_still, stand_still, stand_still, stand_still, stand_still, 0, 0, 0, 0, stand_still, stand_still, 0,
     stand_still, every_period}};
