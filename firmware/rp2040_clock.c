/* The RP2040's clocks: 48 MHz for its parts, and the timer of 1 us. */
#include "board.h"
#include "rp2040_registers.h"

#define ALARM_LEAST_US 20 /* the longest time from reading the timer to setting its alarm */
#define TICK_US 4
#define CRYSTAL_MHZ 12
#define CRYSTAL_ON (0xFABu << 12 | 0xAA0u)
#define CRYSTAL_WAIT 47 /* of 256 periods: 1 ms until it is stable */
#define STABLE (1u << 31)
#define PLL_LOCKED (1u << 31)
#define PLL_MULTIPLIER 100 /* 1200 MHz */
#define PLL_DIVISORS (5u << 16 | 5u << 12) /* 48 MHz */
#define PLL_OFF (1u << 5 | 1u << 3 | 1u) /* parts of the PLL that are off; bit 2 is for another mode */
#define POST_DIVISORS_OFF (1u << 3)

/* 48 MHz from the crystal for the core, the UART and the converter; 1 us for timer and watchdog. */
void rp2040_start_clocks(void)
{
    REGISTER(CRYSTAL + 0xC) = CRYSTAL_WAIT;
    REGISTER(CRYSTAL) = CRYSTAL_ON;
    while (!(REGISTER(CRYSTAL + 4) & STABLE))
        ;
    REGISTER(CLOCKS + 0x30) = 2; /* reference: the crystal */
    while (!(REGISTER(CLOCKS + 0x38) & 1 << 2))
        ;
    REGISTER(PLL_USB) = 1;
    REGISTER(PLL_USB + 8) = PLL_MULTIPLIER;
    CLEAR(PLL_USB + 4) = PLL_OFF & ~POST_DIVISORS_OFF;
    while (!(REGISTER(PLL_USB) & PLL_LOCKED))
        ;
    REGISTER(PLL_USB + 0xC) = PLL_DIVISORS;
    CLEAR(PLL_USB + 4) = POST_DIVISORS_OFF;
    REGISTER(CLOCKS + 0x3C) = 1u << 5; /* system, still from the reference: next source the PLL of USB */
    SET(CLOCKS + 0x3C) = 1;
    while (!(REGISTER(CLOCKS + 0x44) & 1 << 1))
        ;
    REGISTER(CLOCKS + 0x48) = 1u << 11; /* UART: the system clock */
    REGISTER(CLOCKS + 0x60) = 1u << 11; /* converter: the PLL of USB */
    REGISTER(CLOCKS + 0x54) = 1u << 11; /* USB: its PLL */
    REGISTER(WATCHDOG_TICK) = 1u << 9 | CRYSTAL_MHZ;
}

static uint16_t alarm_times[2];

/* The timer of 1 us runs since the reset. */
void board_start_clock(void)
{
    REGISTER(TIMER_ENABLED) = 1 << ALARM_MILLISECOND | 1 << ALARM_SAMPLE;
}

ticks_t board_now(void)
{
    uint32_t high, low;
    do {
        high = REGISTER(TIMER_HIGH);
        low = REGISTER(TIMER_LOW);
    } while (high != REGISTER(TIMER_HIGH));
    return high << 30 | low >> 2;
}

uint16_t board_now_low(void)
{
    return (uint16_t)(REGISTER(TIMER_LOW) >> 2);
}

void board_alarm(uint8_t alarm, uint16_t time)
{
    alarm_times[alarm] = time;
    uint32_t now = REGISTER(TIMER_LOW);
    int32_t wait = (int16_t)(time - (uint16_t)(now >> 2)) * TICK_US;
    REGISTER(TIMER_ALARM(alarm)) = now + (uint32_t)(wait < ALARM_LEAST_US ? ALARM_LEAST_US : wait);
}

/* An alarm rings once, so one that rang before its time is set again. */
void rp2040_repeat(uint8_t alarm)
{
    if (!(REGISTER(TIMER_ARMED) & 1u << alarm))
        board_alarm(alarm, alarm_times[alarm]);
}
