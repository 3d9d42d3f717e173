/* arena.h -- one block of memory, carved into arrays in two passes: count, then take.
 *
 * A module's `xxx_layout(x, arena, ...)` takes its arrays from the arena.  With base = NULL it only
 * counts, so that the same function says how much memory is needed and hands it out.  Nothing else in
 * the runtime allocates. */
#ifndef LAGFMU_ARENA_H
#define LAGFMU_ARENA_H

#include <stddef.h>

typedef struct {
    char *base;
    size_t used;
} Arena;

static inline void *arena_take(Arena *arena, size_t count, size_t size) {
    void *here = arena->base == NULL ? NULL : arena->base + arena->used;
    arena->used += (count * size + 15) / 16 * 16;
    return here;
}

static inline double *arena_doubles(Arena *arena, int count) {
    return arena_take(arena, (size_t)count, sizeof(double));
}

static inline int *arena_ints(Arena *arena, int count) {
    return arena_take(arena, (size_t)count, sizeof(int));
}

#endif
