/* status.c -- causes of failures as text; floating-point numbers are to be printed with %.17g. */
#include "status.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* Behind the first `used` letters; what does not fit ends in dots, so that no part of a number passes for it. */
static void write_from(Why *why, size_t used, const char *format, va_list arguments) {
    static const char dots[] = " ...";
    const int length = vsnprintf(why->text + used, sizeof why->text - used, format, arguments);
    if (length >= (int)(sizeof why->text - used)) memcpy(why->text + sizeof why->text - sizeof dots, dots, sizeof dots);
}

Status fail(Why *why, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    write_from(why, 0, format, arguments);
    va_end(arguments);
    return FAILED;
}

void why_append(Why *why, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    write_from(why, strlen(why->text), format, arguments);
    va_end(arguments);
}
