/* importer.c -- a run of an FMU for a page, compiled with the FMU's own sources to wasm32: below the FMI, for a
 * page knows the instance itself.
 *
 * JavaScript cannot be told a text by C, and a call for each step would cost more than the step: so messages are
 * kept, and a run is one call.  A module is one page's own, so that its instance and its log may be static. */
#include <stdlib.h>
#include <string.h>

#include "batch.h"

#define EXPORT(name) __attribute__((export_name(#name)))

enum { ROOM = 1 << 16 };
static char text[ROOM]; /* messages: the note as a digit, the text, a zero byte; one after the other */
static size_t used;
static Instance *instance;
static double reached;

static void keep_message(void *context, Note note, const char *message) {
    const size_t length = strlen(message) + 2;
    (void)context;
    if (used + length > ROOM) return; /* full: the first messages say why */
    text[used] = (char)('0' + (int)note);
    memcpy(text + used + 1, message, length - 1);
    used += length;
}

EXPORT(page_log) const char *page_log(void) { return text; }

EXPORT(page_log_size) int page_log_size(void) { return (int)used; }

/* Zeroed memory, for what the page hands in and reads; NULL if there is not so much. */
EXPORT(page_memory) void *page_memory(unsigned bytes) { return calloc(1, bytes); }

EXPORT(page_release) void page_release(void *memory) { free(memory); }

/* The one instance, made at the first run. */
static Instance *made(void) {
    Instance draft;
    Arena arena = {NULL, 0};
    memset(&draft, 0, sizeof draft);
    (void)arena_take(&arena, 1, sizeof(Instance));
    instance_layout(&draft, &arena);
    arena = (Arena){calloc(1, arena.used), 0};
    if (arena.base == NULL) return NULL;
    Instance *x = arena_take(&arena, 1, sizeof *x);
    instance_layout(x, &arena);
    x->tell = keep_message;
    return x;
}

/* A run over `points` communication points `times` [s] after `varied` variables were set, tolerance 0: the FMU's
 * own; `kept` values a point into `rows`, as far as page_reached() says.  A RunStatus; -1 without memory. */
EXPORT(page_run)
int page_run(int varied, const unsigned *vary, const double *values, double tolerance, int points,
             const double *times, int kept, const unsigned *keep, double *rows) {
    int status = -1;
    used = 0;
    if (instance == NULL) instance = made();
    const size_t width = (size_t)kept;
    double *room = calloc(3 * width + 1, sizeof *room); /* result, scratch */
    int *last = calloc(width + 1, sizeof *last);        /* KEEP_LAST */
    if (instance != NULL && room != NULL && last != NULL) {
        Batch batch = {.runs = 1, .varied = (size_t)varied, .points = (size_t)points, .kept = width,
                       .vary = vary, .values = values, .times = times, .tolerance = tolerance, .keep = keep,
                       .what = last, .whole = 1, .result = room, .trajectory = rows, .status = &status,
                       .reached = &reached, .scratch = room + width};
        batch_run(instance, &batch);
    }
    free(room);
    free(last);
    return status;
}

/* The time to which the latest run came [s]. */
EXPORT(page_reached) double page_reached(void) { return reached; }
