/* input_jump.c -- the state with which a step begins after inputs were set, to which everything belongs that is read
 * before that step: the limit from the right.
 *
 * Switches have the states of now, what a prescribed motion carries goes with it, and modes that the
 * new forces contradict are settled (modes.h). */
#include "optional.h"
#include "segment.h"

/* What closed contacts and other constraints do when motions are prescribed anew. */
static Status carry(Solver *s) {
    const System *system = s->system;
    if (system->contacts == 0)
        system_active(system, s->state.closed, s->active);
    else if (OPTIONAL.contacts->departures(s, s->state.now.span, 0) != OK)
        return FAILED;
    const Instant at = segment_instant(s, s->state.now.t);
    if (mechanism_project(&s->stepped, at, s->state.q, s->state.v, s->active, s->state.offset, s->state.span) != OK)
        return FAILED;
    return system->contacts > 0 ? OPTIONAL.contacts->push_out(s) : OK;
}

static Status follow_contacts(Solver *s) {
    return s->system->contacts + s->system->frictions == 0 ? OK : OPTIONAL.contacts->contradicted(s);
}

/* What rests on a surface at which forces jump may be about to leave it. */
static Status follow_switches(Solver *s, int *changed) {
    const Instant at = segment_instant(s, s->state.now.t);
    *changed = 0;
    if (s->system->switches == 0) return OK;
    segment_begin(s);
    if (mechanism_motion(&s->stepped, at, s->state.q, s->state.v, s->active) != OK) return FAILED;
    OPTIONAL.switches->settle(s, at, s->state.q, s->state.v, s->stepped.vdot, changed);
    return OK;
}

static Status follow_inputs(Solver *s, void *context, int c, double part) {
    int changed;
    (void)context;
    (void)c;
    (void)part;
    if (!s->state.now.ahead && s->system->switches > 0)
        OPTIONAL.switches->settle(s, segment_instant(s, s->state.now.t), s->state.q, s->state.v, NULL, NULL);
    if (s->drive.jumped && s->system->frictions > 0 && OPTIONAL.friction->slip_off(s, carry) != OK) return FAILED;
    if (s->system->prescribed_count > 0 && carry(s) != OK) return FAILED;
    if (s->system->frictions > 0 && OPTIONAL.friction->renew(s) != OK) return FAILED;
    if (!s->drive.turned) return OK;
    if (follow_contacts(s) != OK || follow_switches(s, &changed) != OK) return FAILED;
    return changed ? follow_contacts(s) : OK;
}

Status solver_follow(Solver *s) {
    return s->columns > 0 && s->drive.turned ? OPTIONAL.variation->jump(s, follow_inputs)
                                             : follow_inputs(s, NULL, 0, 0);
}

Status solver_look(Solver *s) {
    s->state.looking = 1;
    const Status status = follow_inputs(s, NULL, 0, 0);
    s->state.looking = 0;
    return status;
}

void solver_inputs_changed(Solver *s) {
    Numbers *now = &s->state.now;
    now->ahead = 0;
    now->event_count = 0;
    now->fresh = 1;
    s->shown = 0;
}
