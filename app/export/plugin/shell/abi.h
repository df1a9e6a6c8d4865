/* What interfaces in C have in common: what is seen from outside, and places of fields. */

#ifndef LS_ABI_H
#define LS_ABI_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define LS_EXPORT __declspec(dllexport)
#else
#define LS_EXPORT __attribute__((visibility("default")))
#endif

#define AT(type, field, offset) _Static_assert(offsetof(type, field) == (offset), #type "." #field)

#endif
