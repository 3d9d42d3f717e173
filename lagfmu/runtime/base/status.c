/* status.c -- causes of failures as text; floating-point numbers are to be printed with %.17g. */
#include "status.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

Status fail(Why *why, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(why->text, sizeof why->text, format, arguments);
    va_end(arguments);
    return FAILED;
}

void why_append(Why *why, const char *format, ...) {
    size_t used = strlen(why->text);
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(why->text + used, sizeof why->text - used, format, arguments);
    va_end(arguments);
}
