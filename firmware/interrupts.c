/* Common entry of all interrupts. The compiler would save and restore a dozen registers in each of
   eleven handlers, a tenth of the image; here this code exists once and gets the handler's number. */
#include <avr/interrupt.h>
#include <avr/io.h>

#include "analog.h"
#include "clock.h"
#include "link.h"
#include "reset.h"
#include "wheel.h"

enum { EDGE, RECEIVED = 8, EMPTY = 10, OVERFLOW = 12, MILLISECOND, SAMPLE, CONVERTED };

#define ENTRY(vector, number) \
    ISR(vector, ISR_NAKED) \
    { \
        __asm__ volatile("push r24\n\tldi r24, %0\n\tjmp interrupts_enter" ::"M"(number)); \
    }

ENTRY(INT0_vect, EDGE + 0)
ENTRY(INT1_vect, EDGE + 1)
ENTRY(INT4_vect, EDGE + 4)
ENTRY(INT5_vect, EDGE + 5)
ENTRY(USART0_RX_vect, RECEIVED + 0)
ENTRY(USART1_RX_vect, RECEIVED + 1)
ENTRY(USART0_UDRE_vect, EMPTY + 0)
ENTRY(USART1_UDRE_vect, EMPTY + 1)
ENTRY(TIMER1_OVF_vect, OVERFLOW)
ENTRY(TIMER1_COMPA_vect, MILLISECOND)
ENTRY(TIMER1_COMPB_vect, SAMPLE)
ENTRY(ADC_vect, CONVERTED)

/* Saves the registers that a function may change (avr-gcc ABI), calls interrupts_serve, restores. */
__attribute__((naked, used, externally_visible)) void interrupts_enter(void)
{
    __asm__ volatile(
        "push r0\n\t" "in r0, __SREG__\n\t" "push r0\n\t" "push r1\n\t" "clr r1\n\t"
        "push r18\n\t" "push r19\n\t" "push r20\n\t" "push r21\n\t" "push r22\n\t" "push r23\n\t"
        "push r25\n\t" "push r26\n\t" "push r27\n\t" "push r30\n\t" "push r31\n\t"
        "call interrupts_serve\n\t"
        "pop r31\n\t" "pop r30\n\t" "pop r27\n\t" "pop r26\n\t" "pop r25\n\t"
        "pop r23\n\t" "pop r22\n\t" "pop r21\n\t" "pop r20\n\t" "pop r19\n\t" "pop r18\n\t"
        "pop r1\n\t" "pop r0\n\t" "out __SREG__, r0\n\t" "pop r0\n\t" "pop r24\n\t" "reti");
}

__attribute__((used, externally_visible)) void interrupts_serve(uint8_t number)
{
    if (number < RECEIVED)
        encoders_edge(number == LEFT->encoder.interrupt ? &LEFT->encoder : &RIGHT->encoder);
    else if (number < EMPTY)
        link_received(number - RECEIVED);
    else if (number < OVERFLOW)
        link_empty(number - EMPTY);
    else if (number == OVERFLOW)
        clock_overflow();
    else if (number == MILLISECOND) {
        clock_millisecond();
        if (reset_hung())
            wheels_release();
    } else if (number == SAMPLE) {
        clock_sample();
        analog_convert();
    } else
        analog_converted();
}
