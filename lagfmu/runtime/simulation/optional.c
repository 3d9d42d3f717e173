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
    .events_find = events_find,
    .contacts_modes = contacts_modes,
    .impact_check = impact_check,
    .landing_push_out = landing_push_out,
    .landing_bring_back = landing_bring_back,
    .modes_switch = modes_switch,
    .modes_departures = modes_departures,
    .modes_contradicted = modes_contradicted,
    .switches = &SWITCHES,
    .crossing_begins = crossing_begins,
    .passage = &PASSAGE,
    .friction = &FRICTION_EVENTS,
    .variation = &VARIATION,
    .sliding_along = sliding_along,
    .joints = &JOINT_START,
};

SHARED_VALUE const Feature *const *const FEATURES = (const Feature *const[]){NULL};
