/* The interrupts of AVR boards. Each calls the module that it belongs to; the clock's overflow is in the
   board's file. */
#include <avr/interrupt.h>
#include <avr/io.h>

#include "analog.h"
#include "clock.h"
#include "link.h"
#include "ranges.h"
#include "reset.h"
#include "two_wire.h"
#include "wheel.h"

/* The clock's timer of board_<name>.c, and the only UART, which has no number. */
#ifdef __AVR_ATmega328P__
#define CLOCK_COMPARE(channel) TIMER2_COMP##channel##_vect
#define USART0_RX_vect USART_RX_vect
#define USART0_UDRE_vect USART_UDRE_vect
#else
#define CLOCK_COMPARE(channel) TIMER1_COMP##channel##_vect
#endif

static inline void edge(uint8_t number)
{
    encoders_edge(number == LEFT->encoder.interrupt ? &LEFT->encoder : &RIGHT->encoder);
}

ISR(INT0_vect)
{
    edge(0);
}

ISR(INT1_vect)
{
    edge(1);
}

#ifdef INT4_vect
ISR(INT4_vect)
{
    edge(4);
}

ISR(INT5_vect)
{
    edge(5);
}
#endif

ISR(PCINT0_vect)
{
    ranges_changed();
}

ISR(PCINT1_vect, ISR_ALIASOF(PCINT0_vect));
ISR(PCINT2_vect, ISR_ALIASOF(PCINT0_vect));

ISR(USART0_RX_vect)
{
    link_received(0);
}

ISR(USART0_UDRE_vect)
{
    link_empty(0);
}

#if LINKS > 1
ISR(USART1_RX_vect)
{
    link_received(1);
}

ISR(USART1_UDRE_vect)
{
    link_empty(1);
}
#endif

ISR(CLOCK_COMPARE(A))
{
    clock_millisecond();
    if (reset_hung())
        wheels_release();
}

ISR(CLOCK_COMPARE(B))
{
    if (clock_sample())
        analog_convert();
}

ISR(ADC_vect)
{
    analog_converted();
}

ISR(TWI_vect)
{
    two_wire_stepped(TWSR & 0xF8); /* without the prescaler's bits */
}
