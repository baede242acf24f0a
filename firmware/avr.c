/* The hardware layer's parts that all AVR boards share: serial links, analog converter, EEPROM, reset,
   stack, external interrupts, sleep. */
#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <util/delay.h>

#include "atomic.h"
#include "avr_pins.h"
#include "board.h"
#include "protocol.h"

#define PAINT 0xA5
#define TWO_WIRE_RATE 100000UL
#define HALF_PULSE_US 5 /* of the bus clock at that rate */
#define GAP 64

/* Divisors at 16 MHz, double speed, for 9600, 19200, 38400, 57600, 115200 baud. */
static const uint8_t divisors[] PROGMEM = {207, 103, 51, 34, 16};

/* Registers of a UART, in the order of the data sheet: UCSRA, UCSRB, UCSRC, -, UBRR, UDR. Every AVR
   with several UARTs has them eight bytes apart. */
#define UART(link) (&UCSR0A + 8 * (link))
#define STATE 0
#define CONTROL 1
#define FORMAT 2
#define DIVISOR 4
#define DATA 6

__attribute__((noinline)) void board_set_baud(uint8_t link, uint8_t baud)
{
    UART(link)[STATE] = 1 << U2X0;
    *(volatile uint16_t *)(UART(link) + DIVISOR) = pgm_read_byte(&divisors[baud]);
}

void board_start_link(uint8_t link, uint8_t baud)
{
    board_set_baud(link, baud);
    UART(link)[FORMAT] = 1 << UCSZ01 | 1 << UCSZ00;
    UART(link)[CONTROL] = 1 << RXEN0 | 1 << TXEN0 | 1 << RXCIE0;
}

uint8_t board_received(uint8_t link)
{
    return UART(link)[DATA];
}

void board_send(uint8_t link, uint8_t byte)
{
    UART(link)[DATA] = byte;
}

void board_sending(uint8_t link, bool on)
{
    ATOMIC
    {
        if (on)
            UART(link)[CONTROL] |= 1 << UDRIE0;
        else
            UART(link)[CONTROL] &= (uint8_t)~(1 << UDRIE0);
    }
}

void board_convert(uint8_t channel)
{
    ADMUX = (uint8_t)(1 << REFS0 | (channel & 7));
#ifdef MUX5
    ADCSRB = channel > 7 ? 1 << MUX5 : 0;
#endif
    ADCSRA = 1 << ADEN | 1 << ADSC | 1 << ADIE | 7; /* 125 kHz: 104 us per conversion */
}

uint16_t board_converted(void)
{
    return ADC;
}

#define WIRE_STEP (1 << TWINT | 1 << TWEN | 1 << TWIE)
_Static_assert(WIRE_START == 1 << TWSTA && WIRE_MORE == 1 << TWEA && WIRE_STOP == (1 << TWSTO | 1 << TWIE),
               "bits of TWCR that differ from WIRE_STEP; a stop has no interrupt");

void board_two_wire(uint8_t step)
{
    TWCR = WIRE_STEP ^ step;
}

void board_two_wire_send(uint8_t byte)
{
    TWDR = byte;
}

uint8_t board_two_wire_received(void)
{
    return TWDR;
}

/* board_sda and board_scl. */
#ifdef __AVR_ATmega328P__
#define WIRE_LEVELS PINC
#define WIRE_DIRECTION DDRC
#define WIRE_OUTPUT PORTC
#define SDA (1 << 4)
#define SCL (1 << 5)
#else
#define WIRE_LEVELS PIND
#define WIRE_DIRECTION DDRD
#define WIRE_OUTPUT PORTD
#define SDA (1 << 1)
#define SCL (1 << 0)
#endif

void board_two_wire_release(void)
{
    TWCR = 0;
    TWBR = (F_CPU / TWO_WIRE_RATE - 16) / 2;
    /* Without pull-ups of the chip: a sensor of 3.3 V has its own. */
    WIRE_DIRECTION &= (uint8_t)~SDA;
    WIRE_OUTPUT &= (uint8_t)~SDA;
    WIRE_OUTPUT &= (uint8_t)~SCL;
    if (!(WIRE_LEVELS & SDA)) {
        WIRE_DIRECTION |= SCL;
        _delay_us(HALF_PULSE_US);
    }
    WIRE_DIRECTION &= (uint8_t)~SCL;
}

void board_store_read(uint16_t address, void *to, uint8_t size)
{
    eeprom_read_block(to, (const void *)(uintptr_t)address, size);
}

bool board_store_ready(void)
{
    return eeprom_is_ready();
}

void board_store_clear(uint16_t slot)
{
    board_store_write(slot, UINT8_MAX);
}

void board_store_write(uint16_t address, uint8_t byte)
{
    eeprom_write_byte((uint8_t *)(uintptr_t)address, byte);
}

/* After a watchdog reset the watchdog is still running: stop it before it resets the start-up. */
static uint8_t flags __attribute__((section(".noinit")));
void reset_early(void) __attribute__((naked, used, section(".init3")));
void reset_early(void)
{
    flags = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

uint8_t board_reset_cause(void)
{
    if (flags & 1 << WDRF)
        return RESET_WATCHDOG;
    if (flags & 1 << PORF)
        return RESET_POWER;
    if (flags & 1 << BORF)
        return RESET_BROWNOUT;
    return flags & 1 << EXTRF ? RESET_LINE : RESET_UNKNOWN;
}

void board_start_watchdog(void)
{
    wdt_enable(WDTO_120MS);
}

void board_feed(void)
{
    wdt_reset();
}

extern uint8_t _end;
static uint8_t *lowest; /* lowest address of the stack in use so far */

__attribute__((always_inline)) inline void board_paint_stack(void)
{
    lowest = (uint8_t *)SP;
    for (uint8_t *at = &_end; at < (uint8_t *)SP - 8; at++)
        *at = PAINT;
}

uint16_t board_free_stack(void)
{
    /* Searching from the end of the variables would take milliseconds: start GAP below the last result,
       since no function leaves that many bytes untouched. */
    uint8_t *at = lowest - GAP;
    if (at < &_end)
        at = &_end;
    while (*at == PAINT)
        at++;
    lowest = at;
    return (uint16_t)(at - &_end);
}

void board_mute(uint8_t number)
{
    EIMSK &= (uint8_t)~(1 << number);
}

void board_mute_all(void)
{
    EIMSK = 0;
}

_Static_assert(EDGE_BOTH == 1 && EDGE_FALLING == 2 && EDGE_RISING == 3, "bits ISCn of the data sheet");

void board_sense(uint8_t number, uint8_t sense)
{
#ifdef EICRB
    register_t *control = number < 4 ? &EICRA : &EICRB;
#else
    register_t *control = &EICRA;
#endif
    uint8_t bit = (uint8_t)(1 << number), field = 3;
    for (number &= 3; number != 0; number--) {
        sense = (uint8_t)(sense << 2);
        field = (uint8_t)(field << 2);
    }
    EIMSK &= (uint8_t)~bit;
    *control = (uint8_t)((*control & ~field) | sense);
    EIFR = bit;
    EIMSK |= bit;
}

void board_watch(const bit_t *bit)
{
    PCICR = 0;
    if (!bit)
        return;
    uint8_t group = board_group(bit);
    (&PCMSK0)[group] = bit->mask;
    PCIFR = 7;
    PCICR = (uint8_t)(1 << group);
}

void board_start_interrupts(void)
{
    SMCR = 1 << SE; /* idle mode: timers and serial ports keep running */
    sei();
}

void board_sleep(void)
{
    sleep_cpu();
}
