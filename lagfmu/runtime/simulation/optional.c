/* optional.c -- a simulation with all methods and everything that it can do by itself: what runs without an FMU. */
#include "optional.h"

#include "feature.h"

SHARED const Method dop853, rk4, radau, rattle, inverse_dynamics;

SHARED_VALUE const Optional OPTIONAL = {
    .methods = {&inverse_dynamics, &dop853, &dop853, &rk4, &radau, &rattle}, /* in the order of lagfmu/methods.py */
    .implicit = &radau,
    .led = inverse_dynamics_applies,
    .events = &EVENTS,
    .contacts = &CONTACTS,
    .switches = &SWITCHES,
    .crossing = &CROSSING,
    .passage = &PASSAGE,
    .friction = &FRICTION_EVENTS,
    .variation = &VARIATION,
    .sliding_along = sliding_along,
    .joints = &JOINT_START,
};

SHARED_VALUE const Feature *const *const FEATURES = (const Feature *const[]){NULL};
