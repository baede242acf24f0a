/* The interrupts of the RP2040. Each calls the module that it belongs to. */
#include "analog.h"
#include "board.h"
#include "clock.h"
#include "link.h"
#include "ranges.h"
#include "reset.h"
#include "rp2040_registers.h"
#include "rp2040_usb.h"
#include "wheel.h"

void timer_millisecond(void)
{
    REGISTER(TIMER_RAISED) = 1u << ALARM_MILLISECOND;
    clock_millisecond();
    if (reset_hung())
        wheels_release();
    rp2040_repeat(ALARM_MILLISECOND);
}

void timer_sample(void)
{
    REGISTER(TIMER_RAISED) = 1u << ALARM_SAMPLE;
    if (clock_sample())
        analog_convert();
    rp2040_repeat(ALARM_SAMPLE);
}

/* The edges are taken before the levels are read: what changes afterwards interrupts again. */
void pins_changed(void)
{
    edges_t edges;
    for (uint8_t i = 0; i < EDGE_REGISTERS; i++) {
        edges.raised[i] = REGISTER(IO_RAISED + 4 * i);
        REGISTER(IO_EDGES + 4 * i) = edges.raised[i];
    }
    for (wheel_t *wheel = LEFT; wheel <= RIGHT; wheel++) {
        encoder_t *encoder = &wheel->encoder;
        if (rp2040_changed(&edges, encoder->interrupt) || rp2040_changed(&edges, encoder->interrupt_b))
            encoders_edge(encoder);
    }
    if (rp2040_watched_changed(&edges))
        ranges_changed();
}

void uart_ready(void)
{
    uint32_t raised = REGISTER(UART0 + UART_RAISED);
    REGISTER(UART0 + UART_CLEAR) = raised;
    if (raised & UART_RECEIVES)
        link_received(0);
    if (REGISTER(UART0 + UART_MASK) & UART_SENDS && !(REGISTER(UART0 + UART_FLAGS) & UART_FULL))
        link_empty(0);
}

void usb_ready(void)
{
    rp2040_usb_handle();
    if (rp2040_usb_wants_boot()) {
        wheels_release();
        rp2040_boot_from_usb();
    }
    while (rp2040_usb_has_byte())
        link_received(LINK_USB);
    if (!rp2040_usb_begin_packet())
        return;
    while (rp2040_usb_has_room())
        link_empty(LINK_USB);
    rp2040_usb_end_packet();
}

void analog_ready(void)
{
    analog_converted();
}
