#include "log.h"

#include "board.h"

#include <stdatomic.h>

#define RING_LINES 512 /* a power of two; half a second at 1 kHz */
#define LINE_BYTES 96

/* Whole numbers of small units, so that a microcontroller needs no printf: pellucid reads the unit from the header. */
static const char header[] = "time [us],position [u" POSITION_UNIT "],effort [m" EFFORT_UNIT "],drive [m" EFFORT_UNIT "],fault,enable\n";

static log_entry ring[RING_LINES];
static _Atomic uint32_t written, sent; /* one writer each: the loop, and whoever sends */
static _Atomic uint32_t lost;

void log_line(log_entry entry) {
  const uint32_t at = atomic_load_explicit(&written, memory_order_relaxed);
  if (at - atomic_load_explicit(&sent, memory_order_acquire) >= RING_LINES) {
    atomic_fetch_add_explicit(&lost, 1, memory_order_relaxed);
    return;
  }
  ring[at % RING_LINES] = entry;
  atomic_store_explicit(&written, at + 1, memory_order_release);
}

uint32_t log_lost(void) { return atomic_load_explicit(&lost, memory_order_relaxed); }

static int put_number(char* to, int64_t number) {
  char digits[20];
  int n = 0, count = 0;
  uint64_t size = number < 0 ? 0u - (uint64_t)number : (uint64_t)number;
  if (number < 0) to[n++] = '-';
  do {
    digits[count++] = (char)('0' + size % 10u);
    size /= 10u;
  } while (size != 0);
  while (count > 0) to[n++] = digits[--count];
  return n;
}

/* A value that is not finite, or too large, leaves its cell empty: a missing sample. */
static int put_scaled(char* to, float value, float scale) {
  const float scaled = value * scale;
  if (!(scaled < 2e9f && scaled > -2e9f)) return 0;
  return put_number(to, (int64_t)(scaled + (scaled < 0.0f ? -0.5f : 0.5f)));
}

static int put_entry(char* to, const log_entry* entry) {
  int n = put_number(to, entry->time_us);
  to[n++] = ',';
  n += put_scaled(to + n, entry->position, 1e6f);
  to[n++] = ',';
  n += put_scaled(to + n, entry->effort, 1e3f);
  to[n++] = ',';
  n += put_scaled(to + n, entry->drive, 1e3f);
  to[n++] = ',';
  n += put_number(to + n, entry->fault);
  to[n++] = ',';
  n += put_number(to + n, entry->enable);
  to[n++] = '\n';
  return n;
}

int log_send(void) {
  static char line[LINE_BYTES];
  static int length, at, has_header;
  for (;;) {
    if (at == length) {
      const uint32_t next = atomic_load_explicit(&sent, memory_order_relaxed);
      if (!has_header) {
        has_header = 1;
        for (length = 0; header[length] != 0; ++length) line[length] = header[length];
      } else {
        if (next == atomic_load_explicit(&written, memory_order_acquire)) return 1;
        length = put_entry(line, &ring[next % RING_LINES]);
        atomic_store_explicit(&sent, next + 1, memory_order_release);
      }
      at = 0;
    }
    if (!board_send(line[at])) return 0;
    ++at;
  }
}
