/* The law of spring_to_zero.py, for `pellucid rank --law`: the same operations in the same order, so the same bits. */
#include <math.h>

static double filtered;

void law_reset(void) { filtered = 0.0; }

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
