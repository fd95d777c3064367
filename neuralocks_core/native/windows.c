/* SPDX-License-Identifier: Apache-2.0 */
/* What a library for Windows otherwise takes from its C library: so that it contains no code but ours. */
#include "platform.h"

#if defined(_WIN32)
int DllMainCRTStartup(void *library, uint32_t reason, void *reserved);
void *(memcpy)(void *to, const void *from, uintptr_t size);
void *(memset)(void *to, int value, uintptr_t size);

int DllMainCRTStartup(void *library, uint32_t reason, void *reserved) {
    (void)library, (void)reason, (void)reserved;
    return 1;
}

#undef memcpy
__attribute__((no_builtin("memcpy"))) void *memcpy(void *to, const void *from, uintptr_t size) {
    for (uintptr_t i = 0; i < size; i++) ((unsigned char *)to)[i] = ((const unsigned char *)from)[i];
    return to;
}

#undef memset
__attribute__((no_builtin("memset"))) void *memset(void *to, int value, uintptr_t size) {
    for (uintptr_t i = 0; i < size; i++) ((unsigned char *)to)[i] = (unsigned char)value;
    return to;
}
#endif
