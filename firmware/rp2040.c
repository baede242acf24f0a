/* The RP2040's start, serial links, analog converter, reset and stack. */
#include "rp2040_registers.h"

#include "atomic.h"
#include "board.h"
#include "protocol.h"
#include "rp2040_usb.h"

#define PAINT 0xA5
void rp2040_start(uint32_t parts)
{
    CLEAR(RESETS) = parts;
    while ((REGISTER(RESETS_DONE) & parts) != parts)
        ;
}

/* Before `main`. The reset has stopped the watchdog and all other parts, and made every pin an input. */
void rp2040_begin(void)
{
    rp2040_start(RESET_PLL_USB | RESET_IO_BANK0 | RESET_PADS_BANK0);
    rp2040_start_clocks();
    rp2040_start(RESET_TIMER | RESET_PWM | RESET_ADC | RESET_UART0 | RESET_USB);
    REGISTER(ADC + ADC_CONTROL) = 1;
    REGISTER(ADC + ADC_QUEUE_CONTROL) = 1u << 24 | 1; /* an interrupt for each result */
    REGISTER(ADC + ADC_ENABLED) = 1;
    rp2040_begin_store();
}

/* Divisors in 1/64 at 48 MHz / 16, for 9600, 19200, 38400, 57600, 115200 baud. */
static const uint16_t divisors[] = {20000, 10000, 5000, 3333, 1667};
#define FORMAT_8_BITS 0x60 /* without a queue: an interrupt for each byte */

void board_set_baud(uint8_t link, uint8_t baud)
{
    if (link == LINK_USB)
        return;
    REGISTER(UART0 + UART_WHOLE) = divisors[baud] / 64;
    REGISTER(UART0 + UART_FRACTION) = divisors[baud] % 64;
    REGISTER(UART0 + UART_FORMAT) = FORMAT_8_BITS; /* takes the divisor over */
}

void board_start_link(uint8_t link, uint8_t baud)
{
    if (link == LINK_USB) {
        rp2040_start_usb();
        return;
    }
    board_set_baud(link, baud);
    REGISTER(UART0 + UART_CONTROL) = 1u << 9 | 1u << 8 | 1;
    REGISTER(UART0 + UART_MASK) = UART_RECEIVES;
    REGISTER(PAD(1)) = PAD_INPUT | PAD_SCHMITT | PAD_PULL_UP; /* without a module there is no noise */
    REGISTER(IO_CTRL(0)) = FUNCTION_UART;
    REGISTER(IO_CTRL(1)) = FUNCTION_UART;
}

uint8_t board_received(uint8_t link)
{
    return link == LINK_USB ? rp2040_usb_received() : (uint8_t)REGISTER(UART0 + UART_DATA);
}

void board_send(uint8_t link, uint8_t byte)
{
    if (link == LINK_USB)
        rp2040_usb_send(byte);
    else
        REGISTER(UART0 + UART_DATA) = byte;
}

/* The unit interrupts when it has become empty, not while it is: its interrupt is called for the first byte. */
void board_sending(uint8_t link, bool on)
{
    if (link == LINK_USB) {
        rp2040_usb_sending(on);
        return;
    }
    ATOMIC
    {
        if (on) {
            SET(UART0 + UART_MASK) = UART_SENDS;
            REGISTER(INTERRUPTS_RAISED) = 1u << INTERRUPT_UART0;
        } else {
            CLEAR(UART0 + UART_MASK) = UART_SENDS;
        }
    }
}

void board_convert(uint8_t channel)
{
    uint8_t pin = (uint8_t)(board_first_analog + channel);
    REGISTER(PAD(pin)) = PAD_NO_OUTPUT;
    REGISTER(IO_CTRL(pin)) = FUNCTION_NONE;
    REGISTER(ADC + ADC_CONTROL) = (uint32_t)channel << 12 | 1u << 2 | 1;
}

/* On the scale of the other boards, 10 bits for 5 V: 4096 are 3.3 V here. */
uint16_t board_converted(void)
{
    return (uint16_t)(REGISTER(ADC + ADC_QUEUE) * (1023u * 33 / 50) >> 12);
}

enum { HAD_POWER_ON = 1 << 8, HAD_RUN_PIN = 1 << 16 };
#define RUNS 0x5EED1E55

/* RAM keeps its content over a dip of the supply that resets the chip. */
static uint32_t run_before __attribute__((section(".noinit")));

uint8_t board_reset_cause(void)
{
    if (REGISTER(WATCHDOG_REASON) & 3)
        return RESET_WATCHDOG;
    uint32_t cause = REGISTER(CHIP_RESET);
    bool had_run = run_before == RUNS;
    run_before = RUNS;
    if (cause & HAD_RUN_PIN)
        return RESET_LINE;
    if (!(cause & HAD_POWER_ON))
        return RESET_UNKNOWN;
    return had_run ? RESET_BROWNOUT : RESET_POWER; /* to the chip they are the same */
}

#define WATCHDOG_US 120000
#define EVERYTHING_BUT_OSCILLATORS 0x1FFFC
#define WATCHDOG_ON (1u << 30)
#define RESET_NOW (1u << 31)

/* It counts twice each microsecond (erratum RP2040-E1). */
void board_feed(void)
{
    REGISTER(WATCHDOG_LOAD) = 2 * WATCHDOG_US;
}

void board_start_watchdog(void)
{
    REGISTER(POWER_WATCHED) = EVERYTHING_BUT_OSCILLATORS;
    board_feed();
    REGISTER(WATCHDOG) = WATCHDOG_ON;
}

/* The boot ROM's function for BOOTSEL, found as in section 2.8.3 of the data sheet. */
void rp2040_boot_from_usb(void)
{
    typedef void (*function_t)(uint32_t light, uint32_t without);
    typedef function_t (*search_t)(const uint16_t *table, uint32_t code);
    volatile uint16_t *rom = (volatile uint16_t *)0x14;
    __asm__("" : "+r"(rom)); /* the compiler takes low addresses for null */
    const uint16_t *table = (const uint16_t *)(uintptr_t)rom[0];
    search_t search = (search_t)(uintptr_t)rom[2];
    REGISTER(WATCHDOG) = 0;
    search(table, 'U' | 'B' << 8)(0, 0);
}

/* An exception that is no interrupt of ours. */
void failed(void)
{
    REGISTER(POWER_WATCHED) = EVERYTHING_BUT_OSCILLATORS;
    REGISTER(WATCHDOG) = RESET_NOW;
    for (;;)
        ;
}

/* The last part of RAM, of which only so much is watched: there are 200 KB more. */
extern uint8_t _stack_watched[], _stack[];

void board_paint_stack(void)
{
    uint8_t *used;
    __asm__("mov %0, sp" : "=r"(used));
    for (volatile uint8_t *at = _stack_watched; at < used; at++)
        *at = PAINT;
}

uint16_t board_free_stack(void)
{
    const uint8_t *at = _stack_watched;
    while (at < _stack && *at == PAINT)
        at++;
    return (uint16_t)(at - _stack_watched);
}

#define INTERRUPTS \
    (1u << INTERRUPT_TIMER_0 | 1u << INTERRUPT_TIMER_1 | 1u << INTERRUPT_USB | 1u << INTERRUPT_PINS | 1u << INTERRUPT_UART0 \
     | 1u << INTERRUPT_ADC)

#define ALL_LATER 0x40404040u
#define PER_REGISTER 4

/* Edges come first, also in the middle of another interrupt: those of a fast wheel follow each other within
   12 us. What they change is read with interrupts off. */
void board_start_interrupts(void)
{
    for (uint32_t first = 0; first <= INTERRUPT_ADC; first += PER_REGISTER)
        REGISTER(INTERRUPT_PRIORITIES + first) = ALL_LATER;
    REGISTER(INTERRUPT_PRIORITIES + INTERRUPT_PINS / PER_REGISTER * PER_REGISTER)
        = ALL_LATER & ~(0xFFu << INTERRUPT_PINS % PER_REGISTER * 8);
    REGISTER(INTERRUPTS_ON) = INTERRUPTS;
    __asm__ volatile("cpsie i" ::: "memory");
}

void board_sleep(void)
{
    __asm__ volatile("wfi" ::: "memory");
}
