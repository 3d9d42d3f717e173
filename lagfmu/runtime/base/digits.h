/* digits.h -- numbers in messages. */
#ifndef LAGFMU_DIGITS_H
#define LAGFMU_DIGITS_H

#include "linkage.h"

/* The text of one number. */
typedef struct {
    char text[32];
} Digits;

/* The shortest decimal that reads back as x; whole numbers end in ".0". */
SHARED Digits digits(double x);

#endif
