/* Stops in any order, and every bit of an exported controller's context: prints how often each promise was broken.
 *
 * Compiled with an exported folder and its test vector. JOINTS is the number of joints of a controller of several. */
#include "replay.h"
#include <stdio.h>

enum { RUNNING = 40, DELAY = 10, LOG = 8 };

static pellucid_context context;
static pellucid_output output;
static pellucid_config config;
static int row;

static void configure(double period) {
  config = variant_of(LAW_VARIANT);
#ifdef JOINTS
  config.whole_watch.reset_delay = (float)(DELAY * period + 0.5 * period);
  config.whole_watch.healthy_samples = 5.0f;
  for (int k = 0; k < JOINTS; ++k) config.watch[k].rest_speed = 1000.0f;
#else
  config.reset_delay = (float)(DELAY * period + 0.5 * period);
  config.healthy_samples = 5.0f;
  config.rest_speed = 1000.0f;
#endif
}

static void step(uint32_t token, int is_heard) {
  pellucid_input input = input_of(&vector_inputs[row++]);
  input.token = token;
#ifdef JOINTS
  if (!is_heard) input.position[1].valid = 0;
#else
  input.drive = input.joint = input.position;
  if (!is_heard) input.position.valid = 0;
#endif
  (void)pellucid_step(&context, &input, &output);
}

static void run(int steps, uint32_t token) {
  for (int k = 0; k < steps; ++k) step(token, 1);
}

static int is_stopped(void) { return output.mode >= PELLUCID_MODE_DAMPED_STOP && output.fault != 0; }

/* Of several motors the one of the joint in doubt. */
static int is_off(void) {
#ifdef JOINTS
  return output.enable[1] == 0;
#else
  return output.enable == 0;
#endif
}

static int is_logged(uint32_t fault) {
  for (uint32_t ago = 0; ago < LOG; ++ago)
    if (pellucid_log(&context, ago).fault == fault) return 1;
  return 0;
}

static void start(void) {
  memset(&context, 0, sizeof context);
  row = 0;
  if (pellucid_init(&context, &config) != 0) printf("start 1\n");
  run(RUNNING, 0);
  if (output.fault != 0) printf("running 1\n");
}

static void stops(void) {
  /* Without a second stop the token ends the first: the cases below could fail. */
  start();
  pellucid_stop(&context);
  run(1, 0);
  run(DELAY + 6, output.challenge);
  printf("never_reset %d\n", is_stopped());

  /* At every period of the pending reset, with the token held all along. */
  int forgotten = 0, no_delay = 0;
  for (int at = 0; at < DELAY - 1; ++at) {
    start();
    pellucid_stop(&context);
    run(1, 0);
    const uint32_t token = output.challenge;
    run(at, token);
    pellucid_stop(&context);
    for (int k = 0; k < DELAY + 8; ++k) {
      step(token, 1);
      forgotten += !is_stopped() || output.challenge == token;
    }
    pellucid_stop(&context);
    run(1, 0);
    const uint32_t next = output.challenge;
    for (int k = 0; k < DELAY - 2; ++k) {
      step(next, 1);
      no_delay += !is_stopped();
    }
  }
  printf("forgotten %d\nno_delay %d\n", forgotten, no_delay);

  /* After a fault, before the first start, between a period and a start, and with a start in between. */
  start();
  step(0, 0);
  const uint32_t fault = output.fault;
  run(3, output.challenge);
  const uint32_t token = output.challenge;
  pellucid_stop(&context);
  run(DELAY + 8, token);
  printf("after_fault %d\n", !is_stopped() || output.fault != fault || !is_logged(fault) || !is_logged(PELLUCID_STOPPED));
  memset(&context, 0, sizeof context);
  row = 0;
  pellucid_stop(&context);
  int wrong = pellucid_init(&context, &config) != PELLUCID_STOPPED;
  run(5, 0);
  printf("before_start %d\n", wrong || !is_stopped() || !is_off());
  start();
  pellucid_stop(&context);
  wrong = pellucid_init(&context, &config) != PELLUCID_STOPPED;
  run(5, 0);
  printf("between %d\n", wrong || !is_stopped() || !is_off());
  start();
  pellucid_stop(&context);
  run(1, 0);
  const uint32_t held = output.challenge;
  wrong = pellucid_init(&context, &config) != PELLUCID_STOPPED;
  pellucid_stop(&context);
  run(DELAY + 8, held);
  printf("start_between %d\n", wrong || !is_stopped());
}

static void bits(void) {
  start();
  step(0, 0);
  const uint32_t fault = output.fault, token = output.challenge;
  run(3, token);
  const pellucid_context kept = context;
  const int at = row;
  unsigned enabled = 0, log = 0, cleared = 0, count = 0;
  for (size_t bit = 0; bit < 8 * sizeof context; bit += STRIDE) {
    for (int starts = 0; starts < 2; ++starts, ++count) {
      context = kept;
      row = at;
      ((unsigned char*)&context)[bit / 8] ^= (unsigned char)(1u << bit % 8);
      if (starts) cleared += pellucid_init(&context, &config) == 0;
      for (int k = 0; k < 3; ++k) {
        step(token, 1);
        enabled += !is_off();
        cleared += !is_stopped();
      }
      log += !is_logged(fault);
    }
  }
  printf("enabled %u\nlog %u\ncleared %u\ntried %u\n", enabled, log, cleared, count);
}

/* A drive's watchdog that has run out stays so, whichever bit is lost. */
static void watchdog(void) {
  pellucid_watchdog out = {0};
  unsigned powered = 0;
  for (int k = 0; k < 6; ++k) (void)pellucid_watchdog_step(&out, 7, 1, 3);
  for (size_t bit = 0; bit < 8 * sizeof out; ++bit) {
    pellucid_watchdog one = out;
    ((unsigned char*)&one)[bit / 8] ^= (unsigned char)(1u << bit % 8);
    for (int k = 0; k < 6; ++k) powered += pellucid_watchdog_step(&one, 7, 1, 3) != 0;
  }
  printf("watchdog %u\n", powered);
}

int main(void) {
  configure(PERIOD);
  stops();
  bits();
  watchdog();
  return 0;
}
