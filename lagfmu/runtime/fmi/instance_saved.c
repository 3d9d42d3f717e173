/* instance_saved.c -- saved states of an instance (saved_check.c: is what was read from one a state?). */
#include "instance.h"

#include <string.h>

#include "algebraic.h"

/* The numbers of a saved state; its arrays follow. */
typedef struct {
    Numbers now;
    Settings settings, given;
    double since, stop_time;
    INSTANCE_NUMBERS(SAVED_MEMBER)
} Record;
#define PUT(type, member, sort, name) x->member = head.member;
#define TAKE_NUMBER(type, member, sort, name) head.member = x->member;

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
    s->stop_time = head.stop_time;
    s->shown = 0;
    INSTANCE_NUMBERS(PUT)
    if (ALGEBRAIC != NULL) ALGEBRAIC->apply(x);
    x->unsettled = 0;
    x->version += 1;
    instance_settled(x);
    if (ERROR_BARS != NULL) ERROR_BARS->restore(x);
}

void instance_unfollow(Instance *x) {
    const int phase = x->phase;
    if (x->followed != x->version) return;
    instance_restore(x, x->backup);
    x->phase = phase;
}

void instance_save(Instance *x, char *record) {
    instance_unfollow(x);
    if (x->unsettled) (void)instance_settle_states(x);
    const Solver *s = &x->solver;
    Record head;
    memset(&head, 0, sizeof head);
    head.now = s->state.now;
    head.settings = s->settings;
    head.given = x->given;
    head.since = s->drive.since;
    head.stop_time = s->stop_time;
    INSTANCE_NUMBERS(TAKE_NUMBER)
    if (ERROR_BARS != NULL) ERROR_BARS->save(x);
    memcpy(record, &head, sizeof head);
    memset(record + sizeof head, 0, record_head() - sizeof head);
    memcpy(record + record_head(), x->saved, x->saved_size);
}
