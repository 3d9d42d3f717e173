/* advance.c -- from one communication point to the next.
 *
 * Steps are taken and projected within a segment (segment.c); events are found (events.c) and met (modes.c).
 * In a scene without inputs the integrator may stand ahead of the communication point: the state there
 * is read from dense output and projected, on demand if the caller has it so: what nobody looks at costs
 * nothing.  It never passes the stop time, an event that lies ahead is
 * kept until its time, and a step ahead that fails is taken again as far as the communication point. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "feature.h"
#include "indicators.h"
#include "nominals.h"
#include "optional.h"
#include "refused_step.h"
#include "segment.h"
#include "column.h"

enum { CHATTER = 200 };             /* events in next to no time after which the step is given up, ... */
static const double AT_ONCE = 1e-9; /* ... natural times that are next to none */
static const double PATIENCE = 200; /* steps after which a doStep is judged by its average step, ... */
static const double STEP_LIMIT = 1e7; /* ... and the steps that it may need in all */
static const double HEADWAY = 1e-6; /* natural times below which a step makes none */
static const char JUMPS[] = ": is there a force that jumps to and fro?";
static const double AHEAD = 2;        /* natural times of the motion that a step may reach ahead, */
static const double FAR_AHEAD = 1e6;  /* and communication steps: dense output keeps ten digits */

/* Of advance.c alone. */
struct AdvanceMemory {
    double *y, *paused; /* (solver_width()) of a step; of where the caller looks */
    double crowd_since; /* [s] events one upon the other: when they began, ... */
    int crowd;          /* ... and how many there are */
};

void advance_layout(Solver *s, Arena *scratch) {
    struct AdvanceMemory counted, *x = arena_take(scratch, 1, sizeof *x);
    s->part.advance = x;
    if (x == NULL) x = &counted;
    x->y = arena_doubles(scratch, solver_width(s));
    x->paused = arena_doubles(scratch, solver_width(s));
}

static const Method *method_of(const Solver *s) {
    if (s->state.now.led) return OPTIONAL.methods[NO_FREEDOM];
    return s->state.now.choice.implicit ? OPTIONAL.implicit : OPTIONAL.methods[s->settings.method];
}

/* May the integrator stand ahead of the communication point?  Not with inputs, which may change; not
 * at a fixed step, which divides the communication step; not where that costs as much as to step to it; not where a slip
 * may come to rest on the way. */
static int runs_ahead(const Solver *s) {
    if (s->system->inputs > 0 || method_of(s)->fixed || method_of(s)->exact) return 0;
    return s->system->frictions == 0 || !OPTIONAL.friction->turns(s);
}

static void restart(Solver *s, double t, const double *y, double h) {
    integrator_start(&s->integrator, method_of(s), t, y, h);
}

/* The integrator's own numbers, taken from the state, and put back. */
static void resume(Solver *s) {
    const Numbers *now = &s->state.now;
    Integrator *i = &s->integrator;
    i->method = method_of(s);
    i->t_old = now->t_old;
    i->t = now->t_integrator;
    i->h_next = now->h_next;
    i->error_old = now->error_old;
    i->fresh = now->fresh;
}

static void keep(Solver *s) {
    Numbers *now = &s->state.now;
    const Integrator *i = &s->integrator;
    now->t_old = i->t_old;
    now->t_integrator = i->t;
    now->h_next = i->h_next;
    now->error_old = i->error_old;
    now->fresh = i->fresh;
}

/* 1: nothing is left to integrate. */
static int is_led(const Solver *s) {
    return OPTIONAL.methods[NO_FREEDOM] != NULL && !OPTIONAL.methods[s->settings.method]->fixed && s->columns == 0 &&
           OPTIONAL.led(s);
}

/* Puts the integrator at the state; the indicators there. */
static Status set_out(Solver *s) {
    State *x = &s->state;
    double *y = s->part.advance->y;
    state_gather(s->system, x->q, x->v, y);
    if (s->columns > 0) columns_gather(s, y);
    x->now.led = is_led(s);
    if (stiffness_turn(&x->now.choice)) x->now.step = x->now.choice.longest;
    restart(s, x->now.t, y, x->now.step);
    x->now.ahead = 1;
    x->now.event_count = 0;
    x->now.lost_old = x->now.lost_ahead = x->now.lost;
    return indicators_at(s, x->now.t, y, x->indicator);
}

/* What frictions do in the step just taken: their directions at its end, their work. */
static Status slide_on(Solver *s, const double *y1) {
    Numbers *now = &s->state.now;
    const Integrator *i = &s->integrator;
    double lost;
    if (now->event_count > 0) return OK; /* the work is done as far as the event: meet() */
    if (OPTIONAL.friction->work(s, i->t_old, i->t, &lost) != OK) return FAILED;
    if (OPTIONAL.friction->turn(s, i->t, y1) != OK) return FAILED;
    now->lost_ahead += lost; /* of a step that stands: one that failed is taken again */
    return OK;
}

/* To where the integrator stood at t, before a step that failed or cannot be used; h: to try next. */
static void take_back(Solver *s, double t, double h) {
    const Integrator *i = &s->integrator;
    double *y = s->part.advance->y;
    memcpy(y, i->t > t ? i->y_old : i->y, (size_t)i->ny * sizeof *y);
    restart(s, t, y, h);
    s->state.now.event_count = 0;
}

/* One step, that does not end in a singular configuration unless the bound is there. */
static Status step_clear(Solver *s, double bound, double longest) {
    Integrator *i = &s->integrator;
    double h;
    if (segment_step(s, i, bound, longest) != OK) return FAILED;
    if (OPTIONAL.passage == NULL || i->t == bound || !OPTIONAL.passage->landed(s, &h)) return OK;
    take_back(s, i->t_old, h);
    return segment_step(s, i, bound, longest);
}

/* One step, projected and searched for events; `bound`: not to be passed. */
static Status step_towards(Solver *s, double t_end, double bound, double longest) {
    Integrator *i = &s->integrator;
    const int watch = indicators_count(s->system) > 0;
    double *y1 = s->part.advance->y;
    s->state.now.lost_old = s->state.now.lost_ahead;
    if (step_clear(s, bound, longest) != OK) return FAILED;
    if (!(s->taken > 0)) s->first = i->t - i->t_old;
    s->taken = fmax(s->taken, i->t - i->t_old);
    s->state.now.estimated = fmax(s->state.now.estimated, i->error * segment_tolerance(s));
    const int near = OPTIONAL.passage != NULL && OPTIONAL.passage->suspected(s);
    if ((watch || near || features_everywhere(s) || i->t > t_end) && segment_prepare_dense(s, i) != OK) return FAILED;
    if (i->t > t_end) s->state.now.rough = segment_dense_rough(s, i);
    memcpy(y1, i->y, (size_t)i->ny * sizeof *y1);
    if (!i->method->exact && (segment_project(s, i->t, y1) != OK ||
                              segment_check_projection(s, i->t, i->y, y1) != OK))
        return FAILED;
    if (near && OPTIONAL.passage->find(s) != OK) return FAILED;
    if (watch && OPTIONAL.events->find(s, y1) != OK) return FAILED;
    if (s->system->frictions > 0 && slide_on(s, y1) != OK) return FAILED;
    if (s->columns > 0) OPTIONAL.variation->look(s);
    integrator_move(i, y1);
    s->state.now.steps += 1;
    if (s->state.now.choice.implicit) stiffness_implicit_step(&s->state.now.choice, i);
    return OK;
}

/* As far as the communication point, or past it. */
static Status try_step(Solver *s, double t_end) {
    Integrator *i = &s->integrator;
    if (!runs_ahead(s)) return step_towards(s, t_end, t_end, HUGE_VAL);
    const double reach = fmin(AHEAD / s->state.now.rate, FAR_AHEAD * (t_end - s->state.now.t));
    const double longest = fmax(reach, t_end - i->t);
    const double t = i->t, h = i->h_next;
    if (step_towards(s, t_end, fmax(t_end, s->stop_time), longest) == OK) return OK;
    take_back(s, t, fmin(h > 0 ? h : t_end - t, t_end - t));
    return step_towards(s, t_end, t_end, HUGE_VAL);
}

static Magnitudes magnitudes(const Solver *s) {
    return (Magnitudes){s->system->nq, s->system->nv, s->state.size, s->state.span};
}

/* Of `auto`: the step that dop853 took is judged, and the other method takes over if it is due. */
static void choose_method(Solver *s) {
    Integrator *i = &s->integrator;
    Choice *choice = &s->state.now.choice;
    if (!choice->implicit && i->t > i->t_old && stiffness_due(choice) && segment_rate(s, i) == OK)
        stiffness_explicit_step(choice, i, magnitudes(s));
    if (!stiffness_turn(choice)) return;
    double *y = s->part.advance->y;
    memcpy(y, i->y, (size_t)i->ny * sizeof *y);
    restart(s, i->t, y, choice->longest);
}

/* Where radau fails, dop853 goes on; where the constraints alone do not lead on, the chosen method does. */
static Status take_step(Solver *s, double t_end) {
    if (s->settings.method == AUTO && !s->state.now.led) choose_method(s);
    const double t = s->integrator.t;
    const Status status = try_step(s, t_end);
    if (status == OK || !(s->state.now.led || s->state.now.choice.implicit)) return status;
    if (s->state.now.led) {
        s->state.now.led = 0;
        take_back(s, t, 0);
        return try_step(s, t_end);
    }
    stiffness_explicit(&s->state.now.choice, 0);
    take_back(s, t, s->state.now.choice.longest);
    return try_step(s, t_end);
}

static void put(Solver *s, double t, const double *y) {
    state_scatter(s->system, y, s->state.q, s->state.v);
    if (s->columns > 0) columns_scatter(s, y);
    s->state.now.t = t;
    s->state.now.between = 0;
}

/* The state at t, within the step just taken. */
static Status put_between(Solver *s, double t) {
    const Integrator *i = &s->integrator;
    double *y = s->part.advance->y;
    if (i->method->coarse || s->state.now.rough) {
        if (segment_reach(s, i->t_old, i->y_old, t, y) != OK) return FAILED;
    } else {
        i->method->dense(i, t, y);
        if (segment_project(s, t, y) != OK) return FAILED;
    }
    put(s, t, y);
    return OK;
}

/* Tables are looked at and work is summed at each communication point. */
static int waits(const Solver *s) {
    return s->on_demand && !features_everywhere(s) && s->system->lookup_count == 0 && s->system->frictions == 0 && runs_ahead(s);
}

Status solver_arrive(Solver *s) {
    if (!s->state.now.between) return OK;
    resume(s);
    segment_begin(s);
    return put_between(s, s->state.now.t);
}

int solver_pass(Solver *s, double t_end) {
    Numbers *now = &s->state.now;
    if (!(now->ahead && now->t_integrator > t_end && t_end > now->t)) return 0;
    if ((now->event_count > 0 && now->event_time <= t_end) || !waits(s)) return 0;
    now->tiny = 0;
    s->taken = now->t_integrator - now->t_old;
    now->step = now->h_next;
    now->span = t_end - now->t;
    now->t = t_end;
    now->between = 1;
    return 1;
}

/* What frictions have dissipated at t, within the step just taken. */
static Status count_loss(Solver *s, double t) {
    Numbers *now = &s->state.now;
    const Integrator *i = &s->integrator;
    double lost;
    now->lost = now->lost_ahead;
    if (i->t == t && now->event_count == 0) return OK;
    if (OPTIONAL.friction->work(s, i->t_old, t, &lost) != OK) return FAILED;
    now->lost = now->lost_old + lost;
    return OK;
}

static Status check_lost(Solver *s) {
    const Numbers *now = &s->state.now;
    if (isfinite(now->lost) && isfinite(now->lost_old) && isfinite(now->lost_ahead)) return OK;
    return fail(&s->why, "the energy that frictions and impacts dissipate on the way to t = %.17g s is beyond a "
                "double", now->t);
}

/* The communication point is reached, or passed. */
static Status arrive(Solver *s, double t_end) {
    const Integrator *i = &s->integrator;
    Numbers *now = &s->state.now;
    if (i->t == t_end) {
        put(s, t_end, i->y);
    } else if (waits(s)) {
        now->t = t_end;
        now->between = 1;
    } else if (put_between(s, t_end) != OK) {
        return FAILED;
    }
    if (s->system->frictions > 0 && count_loss(s, t_end) != OK) return FAILED;
    FEATURES_DO(s, pass, s, t_end, NULL);
    now->step = i->h_next;
    if (!runs_ahead(s) && !(now->led && s->system->inputs == 0)) now->ahead = 0;
    return OK;
}

/* What the event that has come does to the modes. */
static Status switch_modes(Solver *s, void *context, int c, double part) {
    (void)context;
    (void)c;
    (void)part;
    if (s->system->switches > 0) OPTIONAL.switches->pass(s, s->state.left + s->system->contacts);
    return s->system->contacts + s->system->frictions > 0 ? OPTIONAL.contacts->pass(s, s->state.left) : OK;
}

/* The event in the step just taken: the state there, in the modes before it. */
static Status reach_event(Solver *s) {
    Integrator *i = &s->integrator;
    const double t = s->state.now.event_time;
    double *y = s->part.advance->y;
    if (s->system->frictions > 0 && count_loss(s, t) != OK) return FAILED;
    if (segment_reach(s, i->t_old, i->y_old, t, y) != OK) return FAILED;
    put(s, t, y);
    FEATURES_DO(s, pass, s, t, y);
    s->state.now.step = i->t - i->t_old;
    if (s->state.now.choice.implicit) {
        s->state.now.step = fmin(s->state.now.step, s->state.now.choice.longest);
        stiffness_explicit(&s->state.now.choice, 1);
    }
    s->state.now.ahead = 0;
    s->state.now.event_count = 0;
    s->state.now.pending = 1;
    return OK;
}

/* The modes are switched there. */
Status solver_meet(Solver *s) {
    if (!s->state.now.pending) return OK;
    s->state.now.pending = 0;
    segment_begin(s);
    for (const Feature *const *f = s->features; f != NULL && *f != NULL; f++)
        if ((*f)->before != NULL) (*f)->before(s);
    const Status switched = s->columns > 0 ? OPTIONAL.variation->pass(s, switch_modes) : switch_modes(s, NULL, 0, 0);
    if (switched != OK) return FAILED;
    FEATURES_DO(s, after, s);
    return OK;
}

/* Appends the names of the contacts and frictions that have changed since a time [s]; 0 if there are none. */
static int name_changes(Solver *s, double since) {
    const System *system = s->system;
    const char *begin = ": ";
    for (int i = 0; i < system->contacts + system->frictions; i++) {
        const int friction = i - system->contacts, which = friction < 0 ? i : friction;
        const Latest *on = &s->state.latest[friction < 0 ? CLOSING : STICKING];
        const Latest *off = &s->state.latest[friction < 0 ? DEPARTURE : SLIPPING];
        if (!(on->count[which] > 0 && on->time[which] >= since) &&
            !(off->count[which] > 0 && off->time[which] >= since))
            continue;
        why_append(&s->why, "%s%s '%s'", begin, friction < 0 ? "contact" : "friction",
                   friction < 0 ? system->rows[system->contact[i]].name : system->friction[friction].name);
        begin = ", ";
    }
    return begin[0] == ',';
}

/* Which contacts and frictions have changed again and again since a time [s], or what else it may be. */
static Status tell_of_chatter(Solver *s, double since, const char *otherwise) {
    why_append(&s->why, "%s",
               name_changes(s, since) ? " change without end: do surfaces meet, or does a force jump to and fro?"
                                      : otherwise);
    return FAILED;
}

/* FAILED if the step just taken shows that t_end is too far off for steps of its kind. */
static Status check_headway(Solver *s, double t_end, double begun, Count first) {
    Numbers *now = &s->state.now;
    const Integrator *i = &s->integrator;
    const double t = now->event_count > 0 ? now->event_time : i->t;
    const double done = (double)(now->steps - first), gone = t - begun, most = s->settings.maximum_steps;
    const double h = t - i->t_old, pace = h * now->rate < HEADWAY ? nominals_pace(s) : now->rate;
    if (h * pace < HEADWAY) now->tiny += 1;
    if (most > 0 && (double)now->tiny > most) {
        (void)refused_headway(&s->why, t, t_end, most, HEADWAY / pace, HEADWAY);
        return tell_of_chatter(s, t - most * HEADWAY / pace, JUMPS);
    }
    if (done >= PATIENCE && done * (t_end - begun) > STEP_LIMIT * gone) {
        (void)refused_length(&s->why, t, t_end, STEP_LIMIT, done, begun);
        return tell_of_chatter(s, begun, ": take a shorter one");
    }
    return OK;
}

static int halts_before(const Solver *s, double t_end) {
    return s->halt == HALT_BEFORE || (s->halt == HALT_BEFORE_LAST && s->state.now.t == t_end);
}

/* The caller looks at where the integrator stands; nothing of it is kept but that t_end comes nearer. */
static void pause_there(Solver *s, double *t_end) {
    State *x = &s->state;
    const Integrator *i = &s->integrator;
    const Numbers kept = x->now;
    double *y = s->part.advance->paused;
    if (s->caller.pause == NULL || x->now.event_count > 0 || !(i->t < *t_end)) return;
    state_gather(s->system, x->q, x->v, y);
    if (s->columns > 0) columns_gather(s, y);
    put(s, i->t, i->y);
    x->now.lost = kept.lost_ahead;
    s->caller.pause(s->caller.own, t_end);
    state_scatter(s->system, y, x->q, x->v);
    if (s->columns > 0) columns_scatter(s, y);
    x->now = kept;
    segment_begin(s);
}

/* To t_end, or to the first event before it. */
static Status travel(Solver *s, double *end, double begun, Count first, int *met) {
    Numbers *now = &s->state.now;
    segment_begin(s);
    *met = 0;
    if (!now->ahead && set_out(s) != OK) return FAILED;
    for (;;) {
        const double t_end = *end;
        if (now->event_count > 0 && now->event_time <= t_end) {
            *met = 1;
            if (reach_event(s) != OK) return FAILED;
            return halts_before(s, t_end) ? OK : solver_meet(s);
        }
        if (s->integrator.t >= t_end) return arrive(s, t_end);
        FEATURES_DO(s, pass, s, s->integrator.t, NULL);
        if (take_step(s, t_end) != OK) {
            if (now->approach.near) OPTIONAL.passage->explain(s);
            return FAILED;
        }
        if (check_headway(s, t_end, begun, first) != OK) return FAILED;
        pause_there(s, end);
    }
}

/* FAILED: so many events in next to no time that they may never end. */
static Status check_crowd(Solver *s) {
    const Numbers *now = &s->state.now;
    struct AdvanceMemory *x = s->part.advance;
    if (x->crowd == 0 || !(fabs(now->t - x->crowd_since) < AT_ONCE / nominals_pace(s))) {
        x->crowd_since = now->t;
        x->crowd = 0;
    }
    x->crowd += 1;
    if (x->crowd < CHATTER) return OK;
    (void)refused_crowd(&s->why, now->t, CHATTER, now->t - x->crowd_since);
    return tell_of_chatter(s, x->crowd_since, JUMPS);
}

static Status complete_nominals(Solver *s, double span) {
    segment_begin(s);
    const Instant at = segment_instant(s, s->state.now.t);
    if (mechanism_motion(&s->stepped, at, s->state.q, s->state.v, s->active) != OK) return FAILED;
    return nominals_complete(s, at, span);
}

Status solver_advance(Solver *s, double t_end) {
    Numbers *now = &s->state.now;
    const double begun = now->t;
    const Count first = now->steps;
    if (!(t_end > begun) || !(t_end < HUGE_VAL))
        return fail(&s->why, "a communication step must end after t = %.17g s, got %.17g s", begun,
                    t_end);
    now->tiny = 0;
    s->taken = now->ahead ? now->t_integrator - now->t_old : 0;
    resume(s);
    if (solver_meet(s) != OK || solver_follow(s) != OK) return FAILED;
    if (nominals_incomplete(s) && complete_nominals(s, t_end - begun) != OK) return FAILED;
    if (s->halt == HALT_NEVER) s->part.advance->crowd = 0; /* else they come one in each call */
    while (now->t < t_end) {
        int met;
        if (travel(s, &t_end, begun, first, &met) != OK) return FAILED;
        if (met && check_crowd(s) != OK) return FAILED;
        if (now->pending || (met && s->halt == HALT_AFTER)) break;
    }
    now->span = now->t - begun;
    keep(s);
    return check_lost(s);
}
