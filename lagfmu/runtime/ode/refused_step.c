/* refused_step.c -- in which words a step is refused that cannot be taken. */
#include "refused_step.h"

#include <string.h>

#include "digits.h"

Status refused_step(Why *why, double t, const char *reason, int has_cause) {
    char cause[WHY_LENGTH];
    memcpy(cause, why->text, sizeof cause);
    return fail(why, "the integration stops at t = %s s, %s%s%s", digits(t).text, reason, has_cause ? ": " : "",
                has_cause ? cause : "");
}

Status refused_underflow(Why *why, double t, double h) {
    (void)refused_step(why, t, "step size underflow: the motion is so quick that a step of ", 0);
    why_append(why, "%.3g s leads to no later time (measure time in a smaller unit)", h);
    return FAILED;
}

Status refused_fixed_step(Why *why, double t, const char *method, double h) {
    (void)refused_step(why, t, method, 0);
    why_append(why, "'s step of %.3g s is far too large: reduce solver.step", h);
    return FAILED;
}

Status refused_projection(Why *why, double t, const char *const name[3], double moved) {
    (void)refused_step(why, t, "the projection onto the constraints moves ", 0);
    why_append(why, "%s%s%s by %.3g: the configuration is singular, or nearly so", name[0], name[1], name[2], moved);
    return FAILED;
}

Status refused_headway(Why *why, double t, double t_end, double most, double least, double part) {
    return fail(why,
                "the communication step to t = %.17g s makes no headway at t = %.17g s: more than %.0f internal steps "
                "(solver.maximum_steps) were shorter than %.2g s, %.0e of the motion's natural time",
                t_end, t, most, least, part);
}

Status refused_length(Why *why, double t, double t_end, double most, double done, double begun) {
    return fail(why,
                "the communication step to t = %.17g s would need more than %.0e internal steps, %.0f took it from "
                "t = %.17g s to %.17g s",
                t_end, most, done, begun, t);
}

Status refused_crowd(Why *why, double t, int events, double span) {
    return fail(why, "%d events in %.1g s at t = %.17g s", events, span, t);
}
