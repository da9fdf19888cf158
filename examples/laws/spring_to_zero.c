/* The law of spring_to_zero.py, for `pellucid rank --law`: the same operations in the same order, so the same bits. */
#include <math.h>

#define JOINTS 4

static double filtered, filtered_at[JOINTS];

void law_reset(void) {
  filtered = 0.0;
  for (int k = 0; k < JOINTS; ++k) filtered_at[k] = 0.0;
}

/* The torque for the knee orthosis's spring [N*m]; time [s], position [rad], torque of the spring [N*m]. */
double law_step(double time, double position, double torque) {
  (void)time;
  const double carried = 1.55 * sin(position);
  filtered = filtered + 0.02 * (torque - carried - filtered);
  return carried - 0.4 * filtered;
}

/* The torque for the elbow robot's motor [N*m]; time [s], position [rad], torque of the wearer on the robot [N*m]. */
double elbow_step(double time, double position, double torque) {
  (void)time;
  if (torque == torque) filtered = filtered + 0.02 * (torque - filtered);
  return 2.6 * sin(position) + 0.5 * filtered;
}

/* The torque for each motor of the arm [N*m]; positions [rad] and what the force sensors read, at the joints [N*m]. */
void arm_step(double time, const double position[JOINTS], const double torque[JOINTS], double effort[JOINTS]) {
  (void)time, (void)position;
  for (int k = 0; k < JOINTS; ++k) {
    if (torque[k] == torque[k]) filtered_at[k] = filtered_at[k] + 0.02 * (torque[k] - filtered_at[k]);
    effort[k] = 1.5 * filtered_at[k];
  }
}
