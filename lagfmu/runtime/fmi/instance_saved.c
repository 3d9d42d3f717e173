/* instance_saved.c -- saved states of an instance (restored.c: is what was read from one a state?). */
#include "instance.h"

#include <string.h>

#include "algebraic.h"

/* The numbers of a saved state; its arrays follow. */
typedef struct {
    Numbers now;
    Settings settings, given;
    double since, start_time, stop_time, tolerance, gain;
    int exchange, phase, started, running, warned, moved, ticking, imposed;
} Record;

static size_t record_head(void) { return (sizeof(Record) + 15) / 16 * 16; }

size_t instance_record_size(const Instance *x) { return record_head() + x->saved_size; }

void instance_restore(Instance *x, const char *record) {
    Solver *s = &x->solver;
    Record head;
    memcpy(&head, record, sizeof head);
    memcpy(x->saved, record + record_head(), x->saved_size);
    s->state.now = head.now;
    s->settings = head.settings;
    x->given = head.given;
    s->drive.since = head.since;
    x->start_time = head.start_time;
    s->stop_time = head.stop_time;
    x->tolerance = head.tolerance;
    x->exchange = head.exchange;
    x->phase = head.phase;
    x->started = head.started;
    x->running = head.running;
    x->moved = head.moved;
    x->ticking = head.ticking;
    x->gain = head.gain;
    x->imposed = head.imposed;
    if (ALGEBRAIC != NULL) ALGEBRAIC->apply(x);
    x->warned = head.warned;
    x->observed = x->evaluated = x->followed = 0;
    if (ERROR_BARS != NULL) ERROR_BARS->restore(x);
}

void instance_unfollow(Instance *x) {
    const int phase = x->phase;
    if (!x->followed) return;
    instance_restore(x, x->backup);
    x->phase = phase;
}

void instance_save(Instance *x, char *record) {
    instance_unfollow(x);
    const Solver *s = &x->solver;
    Record head;
    memset(&head, 0, sizeof head);
    head.now = s->state.now;
    head.settings = s->settings;
    head.given = x->given;
    head.since = s->drive.since;
    head.start_time = x->start_time;
    head.stop_time = s->stop_time;
    head.tolerance = x->tolerance;
    head.exchange = x->exchange;
    head.phase = x->phase;
    head.started = x->started;
    head.running = x->running;
    head.warned = x->warned;
    head.moved = x->moved;
    head.ticking = x->ticking;
    head.imposed = x->imposed;
    head.gain = x->gain;
    if (ERROR_BARS != NULL) ERROR_BARS->save(x);
    memcpy(record, &head, sizeof head);
    memset(record + sizeof head, 0, record_head() - sizeof head);
    memcpy(record + record_head(), x->saved, x->saved_size);
}
