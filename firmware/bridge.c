/* Temporary program: connects the USB port (115200 baud) with the port of the radio module (38400, the
   rate of an HC-05 in AT mode), so that a computer can talk to the module through the board. It sets
   no pin: the motors stay as the bootloader left them. Polling is enough: at 115200 baud a byte takes
   1389 cycles, a pass of the loop about 60. */
#include <avr/io.h>
#include <stdint.h>

#define ROOM 128 /* bytes, a power of two; the longest AT command has 40 */
#define USB_DIVISOR 16  /* 115200 baud at 16 MHz and double speed, as in the bootloader */
#define MODULE_DIVISOR 51 /* 38400 */

typedef struct {
    uint8_t head, tail, bytes[ROOM];
} ring_t;

static void put(ring_t *ring, uint8_t byte)
{
    uint8_t next = (uint8_t)(ring->head + 1) % ROOM;
    if (next == ring->tail)
        return; /* ring full: the reply is incomplete and the host repeats the command */
    ring->bytes[ring->head] = byte;
    ring->head = next;
}

static uint8_t get(ring_t *ring)
{
    uint8_t byte = ring->bytes[ring->tail];
    ring->tail = (uint8_t)(ring->tail + 1) % ROOM;
    return byte;
}

int main(void)
{
    ring_t up = {0}, down = {0};
    UCSR0A = UCSR1A = 1 << U2X0;
    UBRR0 = USB_DIVISOR;
    UBRR1 = MODULE_DIVISOR;
    UCSR0C = UCSR1C = 1 << UCSZ01 | 1 << UCSZ00;
    UCSR0B = UCSR1B = 1 << RXEN0 | 1 << TXEN0;
    for (;;) {
        if (UCSR0A & 1 << RXC0)
            put(&down, UDR0);
        if (UCSR1A & 1 << RXC1)
            put(&up, UDR1);
        if (up.head != up.tail && UCSR0A & 1 << UDRE0)
            UDR0 = get(&up);
        if (down.head != down.tail && UCSR1A & 1 << UDRE1)
            UDR1 = get(&down);
    }
}
