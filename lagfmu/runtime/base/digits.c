/* digits.c -- numbers in messages: the shortest decimal text that reads back as the same double. */
#include "digits.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

Digits digits(double x) {
    Digits d;
    if (isnan(x)) {
        strcpy(d.text, "nan");
        return d;
    }
    if (isinf(x)) {
        strcpy(d.text, x > 0 ? "inf" : "-inf");
        return d;
    }
    const double size = fabs(x);
    const int whole = size >= 1 && size < 1e16 ? (int)floor(log10(size)) + 1 : 1;
    for (int precision = whole; precision <= 17; precision++) {
        (void)snprintf(d.text, sizeof d.text, "%.*g", precision, x);
        if (strtod(d.text, NULL) == x) break;
    }
    if (strcspn(d.text, ".,e") == strlen(d.text)) strcat(d.text, ".0");
    return d;
}
