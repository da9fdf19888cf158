/* The equation is that of the identified model with a fifth more inertia and friction: an example, and proof of nothing. */
#include "virtual_joint.h"

#include "pellucid_constants.h"

#define STEP_US 100  /* of the equation */
#define REST_S 1.5f  /* the wearer rests while the start-up test runs */
#define SWING_S 2.0f /* of one swing of the wearer */

static float position, velocity, drive, seconds;
static int64_t until_us; /* the joint's own time */
static int has_begun;

/* A sine without a library, of x turns: three terms are right to a thousandth. */
static float sine_of_turns(float x) {
  const float turn = x - (float)(int32_t)(x + (x < 0.0f ? -0.5f : 0.5f));
  const float folded = turn > 0.25f ? 0.5f - turn : turn < -0.25f ? -0.5f - turn : turn;
  const float a = 6.2831853f * folded, square = a * a;
  return a * (1.0f - square / 6.0f * (1.0f - square / 20.0f * (1.0f - square / 42.0f)));
}

static void move(float h) {
  const pellucid_config* c = &pellucid_identified;
  const float inertia = 1.2f * c->body_inertia, level = 1.2f * c->body_coulomb, slope = 1.2f * c->body_viscous;
  const float turns = position / 6.2831853f;
  const float weight = c->body_gravity_sine * sine_of_turns(turns) + c->body_gravity_cosine * sine_of_turns(turns + 0.25f);
  const float swing = seconds < REST_S ? 0.0f : sine_of_turns((seconds - REST_S) / SWING_S);
  /* The wearer's arm follows a swing of 0.3 rad, and gives more than friction where the joint lags. */
  const float push = 20.0f * level * (0.3f * swing - position) - 2.0f * level * velocity;
  const float net = drive + push - weight - slope * velocity;
  const float next = velocity + h * (net - (velocity > 0.0f ? level : velocity < 0.0f ? -level : 0.0f)) / inertia;
  const int sticks = velocity == 0.0f ? net <= level && net >= -level : next * velocity < 0.0f;
  velocity = sticks ? 0.0f : next;
  position += h * velocity;
  seconds += h;
}

board_reading virtual_joint_read(int64_t now_us) {
  const float step = 1e-4f; /* of the encoder */
  if (!has_begun) until_us = now_us;
  has_begun = 1;
  for (; until_us + STEP_US <= now_us; until_us += STEP_US) move(1e-6f * STEP_US);
  const float counted = position / step;
  const float reading = step * (float)(int32_t)(counted + (counted < 0.0f ? -0.5f : 0.5f));
  return (board_reading){reading, drive, now_us - until_us, 1};
}

void virtual_joint_drive(float effort, uint32_t enable) { drive = enable ? effort : 0.0f; }
