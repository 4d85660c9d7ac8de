/* Counts the instructions of a fixed-point decoder for a row-wire, in qemu-system-arm -icount shift=0, where an instruction
 * takes 1 ns and SysTick of the machine mps2-an386 counts at 25 MHz. This is the whole program, without a library. */
#define JOINED(a, b) a##b
#define NAME(a, b) JOINED(a, b)
#include HEADER
#include "readings.h"

#define ROUNDS 2000
#define NANOSECONDS_A_TICK 40
#define SYSTICK_CONTROL (*(volatile uint32_t *)0xE000E010u)
#define SYSTICK_RELOAD (*(volatile uint32_t *)0xE000E014u)
#define SYSTICK_VALUE (*(volatile uint32_t *)0xE000E018u)
#define SYSTICK_MOST 0xFFFFFFu

static void host(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

static void print(uint32_t number)
{
    char text[12] = {0};
    char *digit = text + 10;
    *digit = '\n';
    do {
        *--digit = (char)('0' + number % 10u);
        number /= 10u;
    } while (number != 0u);
    host(4, digit);
}

static NAME(BUNDLE, _answer) answer;

static uint32_t ticks(int decodes)
{
    uint32_t sum = 0;
    for (int round = 0; round < ROUNDS; ++round) {
        const uint32_t start = SYSTICK_VALUE;
        if (decodes) {
#ifdef TAKES_ROW
            NAME(BUNDLE, _decode)(1 + round % ROWS, readings[round % ROWS], &answer);
#else
            NAME(BUNDLE, _decode)(readings[round % ROWS], &answer);
#endif
        }
        sum += (start - SYSTICK_VALUE) & SYSTICK_MOST;
    }
    return sum;
}

void start(void)
{
    SYSTICK_RELOAD = SYSTICK_MOST;
    SYSTICK_VALUE = 0;
    SYSTICK_CONTROL = 5;
    const uint32_t loop = ticks(0);
    print((ticks(1) - loop) * NANOSECONDS_A_TICK / ROUNDS);
    print((uint32_t)answer.coordinates_nm[2]);
    host(0x18, (const void *)0x20026);
    for (;;) {
    }
}

__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {(const void *)0x20010000, (const void *)start};
