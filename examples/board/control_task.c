#include "control_task.h"

#include "board.h"
#include "log.h"
#include "pellucid_constants.h"

static pellucid_context controller; /* zero at power-on */
static uint32_t count;              /* of measurements */

int control_start(void) { return pellucid_init(&controller, &pellucid_identified); }

uint32_t control_period(void) {
  const board_reading reading = board_read();
  const int64_t now = board_now_us();
  pellucid_input input = {0};
  pellucid_output output = {0};
  ++count;
  input.now_us = now;
  input.position = (pellucid_sample){reading.position, count, now - reading.age_us, reading.is_valid};
  input.drive = (pellucid_sample){reading.drive, count, now - reading.age_us, reading.is_valid};
  /* What else your law asks for (force, EMG) is set here; an operator's answer to output.challenge is input.token. */
  (void)pellucid_step(&controller, &input, &output);
  board_drive(output.effort, output.enable);
  log_line((log_entry){now, reading.position, output.effort, reading.drive, output.fault, output.enable});
  return output.fault;
}
