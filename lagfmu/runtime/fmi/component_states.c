/* component_states.c -- saved states: whose a block is, and whether it is whole. */
#include <string.h>

#include "component.h"

/* Before the record of a saved state: whose it is, and whether it is whole. */
typedef struct {
    char magic[8];
    unsigned version, order; /* of this layout; 0x01020304 in the byte order of the machine */
    unsigned long long size, checksum;
    char guid[48];
} Head;

static const char MAGIC[8] = "lagfmu";
enum { LAYOUT = 1, ORDER = 0x01020304 };

static size_t saved_size(const Component *c) {
    return sizeof(Head) + instance_record_size(&c->instance);
}

/* FNV-1a (Fowler, Noll & Vo). */
static unsigned long long checksum(const char *bytes, size_t size) {
    unsigned long long sum = 14695981039346656037ULL;
    for (size_t k = 0; k < size; k++) sum = (sum ^ (unsigned char)bytes[k]) * 1099511628211ULL;
    return sum;
}

static Head head_of(const Component *c) {
    Head head;
    memset(&head, 0, sizeof head);
    memcpy(head.magic, MAGIC, sizeof head.magic);
    head.version = LAYOUT;
    head.order = ORDER;
    head.size = instance_record_size(&c->instance);
    strncpy(head.guid, MODEL_GUID, sizeof head.guid - 1);
    return head;
}

/* NULL if the bytes are a saved state of this FMU, else what is wrong with them. */
static const char *flaw(const Component *c, const char *bytes, size_t size) {
    const Head expected = head_of(c);
    Head head;
    if (size < sizeof head) return "the bytes are too few for a saved state";
    memcpy(&head, bytes, sizeof head);
    if (memcmp(head.magic, MAGIC, sizeof head.magic) != 0) return "the bytes are no saved state";
    if (head.version != LAYOUT || head.order != ORDER || head.size != expected.size ||
        memcmp(head.guid, expected.guid, sizeof head.guid) != 0)
        return "the saved state belongs to another FMU, or to another version or platform of this";
    if (size != saved_size(c)) return "the saved state is cut short or too long";
    return NULL;
}

/* Room for a saved state, unless there is one to be written over. */
static int give_room(Component *c, const Call *call, void **state) {
    Why text;
    if (*state == NULL) *state = c->allocate(1, saved_size(c));
    if (*state != NULL) return CALL_OK;
    (void)fail(&text, "%s: no memory", call->name);
    return component_refuse(c, text.text);
}

int component_save(Component *c, const Call *call, void **state) {
    if (component_forbids(c, call)) return CALL_ERROR;
    if (state == NULL) return component_missing(c, call);
    if (give_room(c, call, state) != CALL_OK) return CALL_ERROR;
    const Head head = head_of(c);
    char *bytes = *state;
    memcpy(bytes, &head, sizeof head);
    instance_save(&c->instance, bytes + sizeof head);
    return CALL_OK;
}

/* Is the phase that was restored one that this instance can be in?  The cause is in why if not. */
static int in_phase(Component *c) {
    Instance *x = &c->instance;
    const int stepping = c->meets ? STEPPING | EVENT : STEPPING;
    const int live = x->exchange ? EXCHANGE : stepping, all = INSTANTIATED | INITIALIZATION | live | TERMINATED;
    const int one = x->phase > 0 && (x->phase & (x->phase - 1)) == 0 && (x->phase & all) != 0;
    if (one && x->running == ((x->phase & (live | TERMINATED)) != 0)) return 1;
    (void)fail(&x->solver.why, "the saved state is none of this FMU's: its mode is %d", x->phase);
    return 0;
}

int component_restore(Component *c, const Call *call, void *state) {
    Why text;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (state == NULL) return component_missing(c, call);
    const char *wrong = flaw(c, state, saved_size(c));
    if (wrong != NULL) return component_refuse(c, wrong);
    instance_save(&c->instance, c->instance.backup);
    const int exchange = c->instance.exchange;
    instance_restore(&c->instance, (const char *)state + sizeof(Head));
    const int other = c->instance.exchange != exchange;
    if (!other && instance_restored(&c->instance) == OK && in_phase(c)) return CALL_OK;
    instance_restore(&c->instance, c->instance.backup);
    if (!other) return component_failed(c, CALL_ERROR);
    (void)fail(&text, "%s: the state was saved by an instance of the other type", call->name);
    return component_refuse(c, text.text);
}

int component_free_state(Component *c, const Call *call, void **state) {
    if (component_forbids(c, call)) return CALL_ERROR;
    if (state == NULL || *state == NULL) return CALL_OK;
    c->release(*state);
    *state = NULL;
    return CALL_OK;
}

int component_serialized_size(Component *c, const Call *call, const void *state, size_t *size) {
    if (component_forbids(c, call)) return CALL_ERROR;
    if (state == NULL || size == NULL) return component_missing(c, call);
    *size = saved_size(c);
    return CALL_OK;
}

int component_serialize(Component *c, const Call *call, const void *state, char *bytes, size_t size) {
    Head head;
    Why text;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (state == NULL || bytes == NULL) return component_missing(c, call);
    if (size < saved_size(c)) {
        (void)fail(&text, "%s: less room than the serialized size", call->name);
        return component_refuse(c, text.text);
    }
    const char *wrong = flaw(c, state, saved_size(c));
    if (wrong != NULL) return component_refuse(c, wrong);
    memcpy(bytes, state, saved_size(c));
    memcpy(&head, bytes, sizeof head);
    head.checksum = checksum(bytes + sizeof head, (size_t)head.size);
    memcpy(bytes, &head, sizeof head);
    return CALL_OK;
}

int component_deserialize(Component *c, const Call *call, const char *bytes, size_t size, void **state) {
    Head head;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (bytes == NULL || state == NULL) return component_missing(c, call);
    const char *wrong = flaw(c, bytes, size);
    if (wrong != NULL) return component_refuse(c, wrong);
    memcpy(&head, bytes, sizeof head);
    if (head.checksum != checksum(bytes + sizeof head, (size_t)head.size))
        return component_refuse(c, "the saved state was altered: its checksum is wrong");
    if (give_room(c, call, state) != CALL_OK) return CALL_ERROR;
    memcpy(*state, bytes, saved_size(c));
    return CALL_OK;
}
