// All of the core. Each header can also be included alone.
#pragma once

#include "biquad.hpp"
#include "drive.hpp"
#include "dual.hpp"
#include "friction.hpp"
#include "gear_friction.hpp"
#include "geared_plant.hpp"
#include "joint.hpp"
#include "lanes.hpp"
#include "loops.hpp"
#include "math.hpp"
#include "plant.hpp"
#include "safety.hpp"
#include "sensor.hpp"
#include "transmission.hpp"
