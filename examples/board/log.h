/* A log in text: a line for each period, kept in a ring until the line to the PC has room. The loop never waits for it. */
#ifndef LOG_H
#define LOG_H

#include <stdint.h>

typedef struct log_entry {
  int64_t time_us;
  float position; /* [rad or m] */
  float effort;   /* asked for [N*m or N] */
  float drive;    /* measured by the drive [N*m or N] */
  uint32_t fault;
  uint32_t enable;
} log_entry;

/* From the loop: keeps an entry, or counts it as lost where the ring is full. */
void log_line(log_entry entry);

/* From outside of the loop: sends what the line has room for. Returns 1 once everything is sent. */
int log_send(void);

/* Lines that were lost because the ring was full. */
uint32_t log_lost(void);

#endif
