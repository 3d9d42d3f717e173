/* system.c -- names of states, and which constraint rows act while the contacts stand as in `closed`.
 *
 * A contact acts while it is closed; a row that belongs to a contact acts while that one is closed;
 * every other row always acts. */
#include "system.h"

static int is_own(const System *s, int i) { return s->own_speed != NULL && s->own_speed[i]; }

StateName system_state_name(const System *s, int j) {
    const int i = j - s->nq, k = j - system_states(s);
    if (k >= 0) return (StateName){k % 2 ? "der(" : "", s->joint[k / 2].name, k % 2 ? ")" : ""};
    if (i < 0) return (StateName){"", s->coordinates[j], ""};
    if (is_own(s, i)) return (StateName){"", s->speeds[i], ""};
    return (StateName){"der(", s->speeds[i], ")"};
}

StateName system_acceleration_name(const System *s, int i) {
    return (StateName){"der(", s->speeds[i], is_own(s, i) ? ")" : ",2)"};
}

void system_active(const System *s, const int *closed, int *active) {
    for (int k = 0; k < s->m; k++)
        active[k] = s->rows[k].kind != CONTACT && s->rows[k].friction == 0;
    for (int i = 0; i < s->contacts; i++) active[s->contact[i]] = closed[i] != 0;
    for (int k = 0; k < s->m; k++) {
        int contact = s->rows[k].while_closed;
        if (s->rows[k].kind != CONTACT && contact >= 0 && s->rows[k].friction == 0) active[k] = active[contact];
    }
}
