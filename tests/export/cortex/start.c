/* Start of a Cortex-M4F: memory, floating-point unit, main; output and exit by semihosting. */
#include <stdint.h>

extern uint32_t stack_top, data_begin, data_end, data_image, bss_begin, bss_end;
int main(void);

static int semihosting(int operation, const void *argument)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void put(const char *text) { semihosting(0x04, text); }

void start(void)
{
    const uint32_t *from = &data_image;
    for (uint32_t *to = &data_begin; to < &data_end;) { *to++ = *from++; }
    for (uint32_t *to = &bss_begin; to < &bss_end;) { *to++ = 0; }
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20; /* CPACR: access to the unit */
    __asm__ volatile("dsb\nisb");
    int code = main();
    uint32_t reason[2] = { 0x20026, (uint32_t)code };
    semihosting(0x20, reason);
    for (;;) { }
}

static void fault(void) { put("fault\n"); uint32_t reason[2] = { 0x20026, 2 }; semihosting(0x20, reason); for (;;) { } }

__attribute__((section(".vectors"), used)) static const void *vectors[16] = {
    &stack_top, (void *)start, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault,
};
