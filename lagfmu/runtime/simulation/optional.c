/* optional.c -- a simulation with all methods and everything that it can do by itself: what runs without an FMU. */
#include "optional.h"

#include "feature.h"

SHARED_VALUE const Optional OPTIONAL = {
    .methods = {[AUTO] = &dop853,
                [DOP853] = &dop853,
                [RK4] = &rk4,
                [RATTLE] = &rattle,
                [RADAU5] = &radau5},
    .rk4_error = rk4_error,
    .rattle_step = rattle_step,
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
