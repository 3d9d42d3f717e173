/* fmi2_states.c -- saved states (section 2.1.8). */
#include "fmi2_component.h"

#include <string.h>

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

fmi2Status fmi2GetFMUstate(fmi2Component component, fmi2FMUstate *FMUstate) {
    Component *c = component;
    if (!component_allowed(c, ANY_MODE)) return component_forbidden(c, "fmi2GetFMUstate");
    if (FMUstate == NULL) return component_missing(c, "fmi2GetFMUstate");
    if (*FMUstate == NULL) *FMUstate = c->callbacks.allocateMemory(1, saved_size(c));
    if (*FMUstate == NULL) return component_refuse(c, "fmi2GetFMUstate: no memory");
    const Head head = head_of(c);
    char *bytes = *FMUstate;
    memcpy(bytes, &head, sizeof head);
    instance_save(&c->instance, bytes + sizeof head);
    return fmi2OK;
}

/* Is the phase that was restored one that this instance can be in?  The cause is in why if not. */
static int in_phase(Instance *x) {
    const int live = x->exchange ? EXCHANGE : STEPPING, all = INSTANTIATED | INITIALIZATION | live | TERMINATED;
    const int one = x->phase > 0 && (x->phase & (x->phase - 1)) == 0 && (x->phase & all) != 0;
    if (one && x->running == ((x->phase & (live | TERMINATED)) != 0)) return 1;
    (void)fail(&x->solver.why, "the saved state is none of this FMU's: its mode is %d", x->phase);
    return 0;
}

fmi2Status fmi2SetFMUstate(fmi2Component component, fmi2FMUstate FMUstate) {
    Component *c = component;
    if (!component_allowed(c, ANY_MODE)) return component_forbidden(c, "fmi2SetFMUstate");
    if (FMUstate == NULL) return component_missing(c, "fmi2SetFMUstate");
    const char *wrong = flaw(c, FMUstate, saved_size(c));
    if (wrong != NULL) return component_refuse(c, wrong);
    instance_save(&c->instance, c->instance.backup);
    const int exchange = c->instance.exchange;
    instance_restore(&c->instance, (const char *)FMUstate + sizeof(Head));
    const int other = c->instance.exchange != exchange;
    if (!other && instance_restored(&c->instance) == OK && in_phase(&c->instance)) return fmi2OK;
    instance_restore(&c->instance, c->instance.backup);
    if (other)
        return component_refuse(c, "fmi2SetFMUstate: the state was saved by an instance of the other type");
    return component_failed(c, fmi2Error);
}

fmi2Status fmi2FreeFMUstate(fmi2Component component, fmi2FMUstate *FMUstate) {
    Component *c = component;
    if (!component_allowed(c, ANY_MODE)) return component_forbidden(c, "fmi2FreeFMUstate");
    if (FMUstate == NULL || *FMUstate == NULL) return fmi2OK;
    c->callbacks.freeMemory(*FMUstate);
    *FMUstate = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component component, fmi2FMUstate FMUstate,
                                      size_t *size) {
    Component *c = component;
    if (!component_allowed(c, ANY_MODE)) return component_forbidden(c, "fmi2SerializedFMUstateSize");
    if (FMUstate == NULL || size == NULL) return component_missing(c, "fmi2SerializedFMUstateSize");
    *size = saved_size(c);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component component, fmi2FMUstate FMUstate,
                                 fmi2Byte serializedState[], size_t size) {
    Component *c = component;
    Head head;
    if (!component_allowed(c, ANY_MODE)) return component_forbidden(c, "fmi2SerializeFMUstate");
    if (FMUstate == NULL || serializedState == NULL) return component_missing(c, "fmi2SerializeFMUstate");
    if (size < saved_size(c))
        return component_refuse(c, "fmi2SerializeFMUstate: less room than fmi2SerializedFMUstateSize says");
    const char *wrong = flaw(c, FMUstate, saved_size(c));
    if (wrong != NULL) return component_refuse(c, wrong);
    memcpy(serializedState, FMUstate, saved_size(c));
    memcpy(&head, serializedState, sizeof head);
    head.checksum = checksum(serializedState + sizeof head, (size_t)head.size);
    memcpy(serializedState, &head, sizeof head);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component component, const fmi2Byte serializedState[],
                                   size_t size, fmi2FMUstate *FMUstate) {
    Component *c = component;
    Head head;
    if (!component_allowed(c, ANY_MODE)) return component_forbidden(c, "fmi2DeSerializeFMUstate");
    if (serializedState == NULL || FMUstate == NULL) return component_missing(c, "fmi2DeSerializeFMUstate");
    const char *wrong = flaw(c, serializedState, size);
    if (wrong != NULL) return component_refuse(c, wrong);
    memcpy(&head, serializedState, sizeof head);
    if (head.checksum != checksum(serializedState + sizeof head, (size_t)head.size))
        return component_refuse(c, "the saved state was altered: its checksum is wrong");
    if (*FMUstate == NULL) *FMUstate = c->callbacks.allocateMemory(1, saved_size(c));
    if (*FMUstate == NULL) return component_refuse(c, "fmi2DeSerializeFMUstate: no memory");
    memcpy(*FMUstate, serializedState, saved_size(c));
    return fmi2OK;
}
