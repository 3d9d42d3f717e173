/* stopwatch.h -- how a run is repeated, timed and printed, the same for every program here.
 *
 * Printed: one line "STEPS EVALUATIONS MEDIAN_NS", then one line of lambda a sample.  The median is
 * over repeated runs of the whole simulation, of the stepping alone: what is done once before the
 * first step (memory, initialization) is outside. */
#ifndef STOPWATCH_H
#define STOPWATCH_H

typedef struct {
    double stop, step;   /* [s] end, and distance between two samples of lambda */
    double tolerance;
    double budget;       /* [s] of measuring */
    int samples;         /* stop / step */
} Task;

typedef struct {
    double ns;           /* time of one run */
    long steps, evaluations;
} Cost;

/* One simulation from its start; lambda (samples, m) is filled.  0 on success. */
typedef int (*Run)(void *context, const Task *task, double *lambda, Cost *cost);

/* Processor time [ns] of this process: what others do on the machine is not counted. */
double now_ns(void);

/* Repeats the run within the budget (three times at least), prints; the exit status of main(). */
int measure(const Task *task, Run run, void *context, int m);

/* TOLERANCE STOP STEP BUDGET from argv[first...]. */
Task task_of(char *argv[], int first);

#endif
