/* random3.c -- an importer of FMI 3.0 that does anything at any time: random calls with random arguments, legal or not;
 * the FMU's sources are linked in, so that a sanitizer or valgrind sees all of it.
 *
 *   random3 TOKEN LIVES CALLS STEP VARIABLES STATES INDICATORS EXCHANGE EVENTS [SWITCH]
 *
 * SWITCH: the value reference of the parameter of FMI-LS-DAE that half of the lives of Model Exchange set.
 *
 * Ends with 0 if no call returned anything but OK, Warning, Discard or Error, no value that was read with OK is not a
 * number, and whatever is not OK was told why. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3_functions.h"

enum { MOST = 4, SAVED = 3, ROOM = 2000 };

static unsigned long long state = 88172645463325252ULL;
static unsigned variables;
static size_t states, indicators;
static double step, now;
static int told, within;
static fmi3Instance one;

static unsigned draw(unsigned below) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (unsigned)(state >> 33) % below;
}

static void expect(int good, int line) {
    if (good) return;
    fprintf(stderr, "random3.c:%d is not as expected\n", line);
    exit(1);
}
#define EXPECT(condition) expect(condition, __LINE__)

static void logger(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message) {
    (void)environment;
    told += (int)(strlen(category) + strlen(message) > 0 && status >= fmi3OK);
}

/* A status, since `before` messages had been told. */
static fmi3Status check(fmi3Status status, int before) {
    EXPECT(status >= fmi3OK && status <= fmi3Error);
    EXPECT(status == fmi3OK || told > before);
    return status;
}
#define CALL(call) check(call, (before = told, before))

static double number(void) {
    static const double ODD[] = {0, -1, NAN, INFINITY, 1e308, 1e-320};
    return draw(64) == 0 ? ODD[draw(6)] : (double)draw(1000) / 500 - 1;
}

static void references(fmi3ValueReference *found, size_t count) {
    for (size_t k = 0; k < count; k++) found[k] = draw(20) == 0 ? 1u << draw(32) : draw(variables);
}

static void exchange_values(void) {
    fmi3ValueReference vr[MOST];
    double values[MOST];
    fmi3Int64 longs[MOST];
    fmi3Int32 ints[MOST];
    bool bools[MOST];
    const size_t count = draw(MOST + 1), values_count = draw(30) == 0 ? count + 1 : count;
    int before;
    references(vr, count);
    for (size_t k = 0; k < MOST; k++) values[k] = number();
    const fmi3ValueReference *some = draw(50) == 0 ? NULL : vr;
    switch (draw(8)) {
        case 0: case 1: case 2:
            if (CALL(fmi3GetFloat64(one, some, count, values, values_count)) == fmi3OK)
                for (size_t k = 0; k < count; k++) EXPECT(isfinite(values[k]));
            break;
        case 3: (void)CALL(fmi3SetFloat64(one, some, count, values, values_count)); break;
        case 4: (void)CALL(fmi3GetInt64(one, some, count, longs, values_count)); break;
        case 5: (void)CALL(fmi3GetInt32(one, some, count, ints, values_count)); break;
        case 6: (void)CALL(fmi3GetBoolean(one, some, count, bools, values_count)); break;
        default:
            for (size_t k = 0; k < MOST; k++) longs[k] = (fmi3Int64)draw(7) << (draw(9) == 0 ? 55 : 0);
            (void)CALL(fmi3SetInt64(one, some, count, longs, values_count));
    }
}

static void differentiate(void) {
    fmi3ValueReference unknowns[MOST], knowns[MOST];
    double seed[MOST], found[MOST];
    fmi3Int32 orders[MOST] = {1, 1, 1, 1};
    const size_t nu = draw(MOST + 1), nk = draw(MOST + 1);
    fmi3DependencyKind kinds[ROOM];
    fmi3ValueReference independents[ROOM];
    size_t of[ROOM], on[ROOM], count = 0;
    int before;
    references(unknowns, nu);
    references(knowns, nk);
    for (size_t k = 0; k < MOST; k++) seed[k] = number();
    switch (draw(4)) {
        case 0: (void)CALL(fmi3GetDirectionalDerivative(one, unknowns, nu, knowns, nk, seed, nk, found, nu)); break;
        case 1: (void)CALL(fmi3GetAdjointDerivative(one, unknowns, nu, knowns, nk, seed, nu, found, nk)); break;
        case 2: (void)CALL(fmi3GetOutputDerivatives(one, unknowns, nu, orders, found, nu)); break;
        default:
            if (CALL(fmi3GetNumberOfVariableDependencies(one, draw(variables), &count)) != fmi3OK || count > ROOM) break;
            (void)CALL(fmi3GetVariableDependencies(one, draw(variables), of, independents, on, kinds, count));
    }
}

static void keep(fmi3FMUState *saved) {
    const unsigned k = draw(SAVED);
    fmi3FMUState copy = NULL;
    size_t size = 0;
    int before;
    switch (draw(4)) {
        case 0: (void)CALL(fmi3GetFMUState(one, &saved[k])); break;
        case 1: (void)CALL(fmi3SetFMUState(one, saved[k])); break;
        case 2: (void)CALL(fmi3FreeFMUState(one, &saved[k])); break;
        default:
            if (CALL(fmi3SerializedFMUStateSize(one, saved[k], &size)) != fmi3OK) break;
            fmi3Byte *bytes = malloc(size);
            if (CALL(fmi3SerializeFMUState(one, saved[k], bytes, size)) == fmi3OK) {
                if (draw(2)) bytes[draw((unsigned)size)] ^= (fmi3Byte)(1 + draw(255));
                if (CALL(fmi3DeserializeFMUState(one, bytes, size, &copy)) == fmi3OK) {
                    if (draw(3)) (void)CALL(fmi3SetFMUState(one, copy));
                    (void)CALL(fmi3FreeFMUState(one, &copy));
                }
            }
            free(bytes);
    }
}

static void integrate(void) {
    double x[ROOM], z[ROOM];
    bool event, end;
    int before;
    switch (draw(8)) {
        case 0:
            if (CALL(fmi3GetContinuousStates(one, x, states)) != fmi3OK) break;
            x[draw((unsigned)states)] += number() / 100;
            (void)CALL(fmi3SetContinuousStates(one, x, states));
            break;
        case 1: (void)CALL(fmi3GetContinuousStateDerivatives(one, x, states)); break;
        case 2: (void)CALL(fmi3GetEventIndicators(one, z, indicators)); break;
        case 3: (void)CALL(fmi3GetNominalsOfContinuousStates(one, x, states)); break;
        case 4: (void)CALL(fmi3CompletedIntegratorStep(one, true, &event, &end)); break;
        case 5: (void)CALL(fmi3SetTime(one, now += step * draw(2))); break;
        case 6: (void)CALL(fmi3EnterContinuousTimeMode(one)); break;
        default: (void)CALL(fmi3SetTime(one, number()));
    }
}

static void go_on(void) {
    bool flags[6];
    double time;
    int before;
    switch (draw(14)) {
        case 0: (void)CALL(fmi3EnterInitializationMode(one, true, 1e-6, 0, false, 0)); break;
        case 1: (void)CALL(fmi3ExitInitializationMode(one)); break;
        case 2: (void)CALL(fmi3EnterEventMode(one)); break;
        case 3: (void)CALL(fmi3UpdateDiscreteStates(one, flags, flags + 1, flags + 2, flags + 3, flags + 4, &time)); break;
        case 4: (void)CALL(fmi3EnterStepMode(one)); break;
        case 5:
            if (draw(20) == 0) (void)CALL(fmi3Reset(one));
            if (draw(20) == 0) (void)CALL(fmi3Terminate(one));
            break;
        case 6: (void)CALL(fmi3SetDebugLogging(one, draw(2), 0, NULL)); break;
        case 7: (void)CALL(fmi3DoStep(one, number(), number(), true, flags, flags + 1, flags + 2, &time)); break;
        default:
            time = now; /* what a step that cannot be done says too, once there are steps */
            if (CALL(fmi3DoStep(one, now, step, true, flags, flags + 1, flags + 2, &time)) == fmi3OK)
                EXPECT(time > now - 1e-9 && time < now + step + 1e-9);
            now = time;
    }
}

static void anything(fmi3FMUState *saved, int exchange) {
    switch (draw(10)) {
        case 0: case 1: case 2: exchange_values(); break;
        case 3: differentiate(); break;
        case 4: keep(saved); break;
        case 5: case 6: if (exchange) { integrate(); break; } go_on(); break;
        default: go_on();
    }
}

static fmi3FMUState kept[SAVED];

static void between(fmi3InstanceEnvironment environment, fmi3Float64 t, fmi3Boolean set, fmi3Boolean get,
                    fmi3Boolean finished, fmi3Boolean early, fmi3Boolean *requested, fmi3Float64 *time) {
    const double held = now;
    (void)environment;
    EXPECT(set != get && get == finished && !within);
    within = 1;
    if (draw(4) == 0) anything(kept, 0);
    if (draw(4) == 0) exchange_values();
    if (draw(50) == 0) {
        *requested = true;
        *time = draw(3) ? t + step * draw(3) / 4 : number();
        (void)early;
    }
    within = 0;
    now = held;
}

/* Continuous-time mode of DAE mode, where multipliers may be set too. */
static void solve_for_multipliers(fmi3ValueReference parameter) {
    const bool on = true;
    bool flags[6];
    double time;
    EXPECT(fmi3EnterConfigurationMode(one) == fmi3OK);
    EXPECT(fmi3SetBoolean(one, &parameter, 1, &on, 1) == fmi3OK);
    EXPECT(fmi3ExitConfigurationMode(one) == fmi3OK);
    EXPECT(fmi3EnterInitializationMode(one, true, 1e-6, 0, false, 0) == fmi3OK);
    EXPECT(fmi3ExitInitializationMode(one) == fmi3OK);
    EXPECT(fmi3UpdateDiscreteStates(one, flags, flags + 1, flags + 2, flags + 3, flags + 4, &time) == fmi3OK);
    EXPECT(fmi3EnterContinuousTimeMode(one) == fmi3OK);
}

int main(int count, char **arguments) {
    if (count < 10) return 2;
    const char *token = arguments[1];
    const long lives = atol(arguments[2]), calls = atol(arguments[3]);
    step = atof(arguments[4]);
    variables = (unsigned)atoi(arguments[5]);
    states = (size_t)atoi(arguments[6]);
    indicators = (size_t)atoi(arguments[7]);
    const int exchanges = atoi(arguments[8]), ticks = atoi(arguments[9]);
    for (long life = 0; life < lives; life++) {
        const int exchange = exchanges && draw(3) == 0;
        fmi3ValueReference named[MOST];
        references(named, MOST);
        one = exchange ? fmi3InstantiateModelExchange("one", token, NULL, false, true, NULL, logger)
                       : fmi3InstantiateCoSimulation("one", token, NULL, false, true, ticks || draw(2), draw(2), named,
                                                     draw(3), NULL, logger, draw(2) ? between : NULL);
        if (one == NULL) continue; /* what was named cannot be */
        now = 0;
        if (exchange && count > 10 && draw(2)) solve_for_multipliers((unsigned)atoi(arguments[10]));
        else if (draw(4)) {
            EXPECT(fmi3EnterInitializationMode(one, true, 1e-6, 0, false, 0) == fmi3OK);
            EXPECT(fmi3ExitInitializationMode(one) == fmi3OK);
            if (!exchange) (void)fmi3EnterStepMode(one);
        }
        for (long k = 0; k < calls; k++) anything(kept, exchange);
        for (int k = 0; k < SAVED; k++) EXPECT(fmi3FreeFMUState(one, &kept[k]) == fmi3OK);
        fmi3FreeInstance(one);
    }
    printf("%d\n", told);
    return 0;
}
