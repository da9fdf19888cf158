/* The loop on a computer with Linux, a Raspberry Pi or the like: absolute deadlines, and real-time priority where permitted.
 *   loop SECONDS LOG.csv
 */
#define _GNU_SOURCE
#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include "board.h"
#include "control_task.h"
#include "log.h"
#include "virtual_joint.h"

#define PRIORITY 80        /* of SCHED_FIFO: above the kernel's own threaded interrupts, below its watchdogs */
#define STACK_BYTES 65536  /* touched before the loop, so that no page is fetched within it */
#define BINS 8

static FILE* file;
static volatile int running = 1;

static int64_t microseconds(struct timespec t) { return (int64_t)t.tv_sec * 1000000 + t.tv_nsec / 1000; }

static void add_period(struct timespec* t) {
  t->tv_nsec += PERIOD_US * 1000;
  if (t->tv_nsec >= 1000000000) {
    t->tv_nsec -= 1000000000;
    ++t->tv_sec;
  }
}

int64_t board_now_us(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return microseconds(t);
}
board_reading board_read(void) { return virtual_joint_read(board_now_us()); }
void board_drive(float effort, uint32_t enable) { virtual_joint_drive(effort, enable); }
int board_send(char byte) { return fputc(byte, file) != EOF; }

/* The log goes to the file from a thread of ordinary priority. */
static void* send_log(void* nothing) {
  const struct timespec pause = {0, 20000000};
  while (running) {
    log_send();
    nanosleep(&pause, 0);
  }
  log_send();
  return nothing;
}

static const char* become_real_time(void) {
  const struct sched_param priority = {PRIORITY};
  unsigned char stack[STACK_BYTES];
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0) return "memory is not locked, a page may be fetched within the loop";
  memset(stack, 1, sizeof stack);
  __asm volatile("" : : "r"(stack) : "memory");
  if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) return "priority is ordinary, another program may be preferred";
  return "SCHED_FIFO and locked memory";
}

int main(int count, char** arguments) {
  const double seconds = count == 3 ? atof(arguments[1]) : 0.0;
  if (!(seconds > 0.0 && seconds < 86400.0)) {
    fprintf(stderr, "loop: expected SECONDS LOG.csv, for example: loop 10 log.csv\n");
    return 2;
  }
  file = fopen(arguments[2], "w");
  if (file == 0) {
    fprintf(stderr, "loop: %s: %s\n", arguments[2], strerror(errno));
    return 2;
  }
  const int refused = control_start();
  if (refused != 0) {
    fprintf(stderr, "loop: the controller does not start, fault %d; pellucid_controller.h names it\n", refused);
    return 1;
  }
  pthread_t sender;
  if (pthread_create(&sender, 0, send_log, 0) != 0) {
    fprintf(stderr, "loop: no thread for the log\n");
    return 2;
  }
  printf("%s\n", become_real_time());

  uint32_t late[BINS] = {0}, missed = 0, fault = 0;
  int64_t latest = 0;
  struct timespec next;
  clock_gettime(CLOCK_MONOTONIC, &next);
  const long periods = (long)(seconds * 1e6 / PERIOD_US);
  for (long i = 0; i < periods; ++i) {
    add_period(&next);
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, 0) == EINTR) {
    }
    const int64_t behind = board_now_us() - microseconds(next);
    int bin = 0;
    while (bin < BINS - 1 && behind >= (int64_t)10 << (2 * bin)) ++bin;
    ++late[bin];
    /* A period that was missed is left out: to catch up would ask the drive for two efforts at once. */
    for (int64_t gone = behind; gone >= PERIOD_US; gone -= PERIOD_US, ++missed) add_period(&next);
    if (behind > latest) latest = behind;
    fault = control_period();
  }
  running = 0;
  pthread_join(sender, 0);
  const int closed = fclose(file);

  printf("%ld periods; woken late by\n", periods);
  for (int bin = 0; bin < BINS; ++bin)
    if (late[bin] > 0) printf("  %s%ld us  %u\n", bin < BINS - 1 ? "less than " : "more than ", 10L << (2 * (bin < BINS - 1 ? bin : bin - 1)), late[bin]);
  printf("latest %ld us, %u periods missed, %u lines of the log lost, fault %u\n", (long)latest, missed, log_lost(), fault);
  if (closed != 0) {
    fprintf(stderr, "loop: %s: %s\n", arguments[2], strerror(errno));
    return 1;
  }
  return fault == 0 ? 0 : 1;
}
