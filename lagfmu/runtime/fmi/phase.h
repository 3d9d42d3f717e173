/* phase.h -- the modes of an instance's life, of every version of FMI, and what a call is.
 *
 * Each version has one table of its calls, which says in which modes each is allowed. */
#ifndef LAGFMU_PHASE_H
#define LAGFMU_PHASE_H

enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    STEP_COMPLETE = 4,
    STEP_FAILED = 8,
    EVENT = 16,
    CONTINUOUS = 32,
    TERMINATED = 64,
    BETWEEN = 128, /* within a communication step: never saved */
    CONFIGURATION = 256, /* nor this one, in which structural parameters are set */
    STEPPING = STEP_COMPLETE | STEP_FAILED,
    EXCHANGE = EVENT | CONTINUOUS,
    READABLE = INITIALIZATION | STEPPING | EXCHANGE | TERMINATED | BETWEEN, /* whatever there is */
    ANY_MODE = INSTANTIATED | INITIALIZATION | STEPPING | EXCHANGE | TERMINATED
};

/* A function of the interface, and the modes in which an instance allows it: one for Model Exchange, one for
 * co-simulation. */
typedef struct {
    const char *name;
    int exchange, steps;
} Call;

#endif
