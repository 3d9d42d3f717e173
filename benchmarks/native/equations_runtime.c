/* equations_runtime.c -- the same through linear.c of our own runtime: the sparse ladder. */
#include <stdlib.h>

#include "equations.h"
#include "linear.h"

typedef struct {
    Linear linear;
    Why why;
    int *active;
    char *block;
} Factors;

int equations_create(Equations *e, const System *s, const double *p) {
    Factors *f = calloc(1, sizeof *f);
    if (f == NULL)
        return 1;
    for (int pass = 0; pass < 2; pass++) {
        Arena arena = {f->block, 0};
        e->M = arena_doubles(&arena, s->masses);
        e->F = arena_doubles(&arena, s->nv);
        e->G = arena_doubles(&arena, s->entries);
        e->nu = arena_doubles(&arena, s->m);
        e->gamma = arena_doubles(&arena, s->m);
        f->active = arena_ints(&arena, s->m);
        linear_layout(&f->linear, &arena, s, &f->why);
        if (pass == 0 && (f->block = calloc(1, arena.used + 16)) == NULL)
            return 1;
    }
    for (int k = 0; k < s->m; k++)
        f->active[k] = 1;
    e->s = s;
    e->p = p;
    e->evaluations = 0;
    e->factors = f;
    return 0;
}

void equations_destroy(Equations *e) {
    Factors *f = e->factors;
    free(f->block);
    free(f);
}

int equations_factor(Equations *e) {
    Factors *f = e->factors;
    return linear_factor(&f->linear, e->M, e->G, f->active) != OK;
}

int equations_solve(Equations *e, const double *b, const double *c, double *x, double *lambda) {
    Factors *f = e->factors;
    return linear_solve(&f->linear, b, c, x, lambda) != OK;
}
