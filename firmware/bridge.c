/* A program for a while: it joins the USB port (115200 baud) to the radio module's (38400, which
   an HC-05 in AT mode always has), so that a computer can speak to the module through the board's
   own wires. It touches no pin: motors stay as the bootloader left them. Polling is enough: at
   115200 baud a byte takes 1389 cycles, one turn of the loop some 60. */
#include <avr/io.h>
#include <stdint.h>

#define ROOM 128 /* bytes, a power of two; the longest AT command has 40 */
#define USB_DIVISOR 16  /* 115200 baud at 16 MHz and double speed, as the bootloader has it */
#define MODULE_DIVISOR 51 /* 38400 */

typedef struct {
    uint8_t head, tail, bytes[ROOM];
} way_t;

static void take(way_t *way, uint8_t byte)
{
    uint8_t next = (uint8_t)(way->head + 1) % ROOM;
    if (next == way->tail)
        return; /* nobody sends so much; the answer will lack it, and be asked for again */
    way->bytes[way->head] = byte;
    way->head = next;
}

static uint8_t give(way_t *way)
{
    uint8_t byte = way->bytes[way->tail];
    way->tail = (uint8_t)(way->tail + 1) % ROOM;
    return byte;
}

int main(void)
{
    way_t up = {0}, down = {0};
    UCSR0A = UCSR1A = 1 << U2X0;
    UBRR0 = USB_DIVISOR;
    UBRR1 = MODULE_DIVISOR;
    UCSR0C = UCSR1C = 1 << UCSZ01 | 1 << UCSZ00;
    UCSR0B = UCSR1B = 1 << RXEN0 | 1 << TXEN0;
    for (;;) {
        if (UCSR0A & 1 << RXC0)
            take(&down, UDR0);
        if (UCSR1A & 1 << RXC1)
            take(&up, UDR1);
        if (up.head != up.tail && UCSR0A & 1 << UDRE0)
            UDR0 = give(&up);
        if (down.head != down.tail && UCSR1A & 1 << UDRE1)
            UDR1 = give(&down);
    }
}
