#include "pins.h"

#include <simavr/avr_ioport.h>
#include <string.h>

/* Pin, TCCRnA, OCRnx, bit COMnx1. */
typedef struct {
    uint8_t pin;
    uint16_t control, compare;
    uint8_t connect;
} output_t;

/* Port and bit of each Arduino pin, from the published pin maps, and the PWM outputs. */
typedef struct {
    const char *mcu, *ports;
    const uint8_t *bits;
    const output_t *outputs;
    unsigned output_count;
} map_t;

static const char mega_ports[] = "EEEEGEHHHHBBBBJJHHDDDDAAAAAAAACCCCCCCCDGGGLLLLLLLLBBBBFFFFFFFFKKKKKKKK";
static const uint8_t mega_bits[] = {0, 1, 4, 5, 5, 3, 3, 4, 5, 6, 4, 5, 6, 7, 1, 0, 1, 0, 3, 2, 1, 0, 0, 1,
                                 2, 3, 4, 5, 6, 7, 7, 6, 5, 4, 3, 2, 1, 0, 7, 2, 1, 0, 7, 6, 5, 4, 3, 2,
                                 1, 0, 3, 2, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7};

static const output_t mega_outputs[] = {
    {2, 0x90, 0x9A, 5},  {3, 0x90, 0x9C, 3},   {5, 0x90, 0x98, 7},    {6, 0xA0, 0xA8, 7},
    {7, 0xA0, 0xAA, 5},  {8, 0xA0, 0xAC, 3},   {9, 0xB0, 0xB4, 5},    {10, 0xB0, 0xB3, 7},
    {4, 0x44, 0x48, 5},  {13, 0x44, 0x47, 7},  {44, 0x120, 0x12C, 3}, {45, 0x120, 0x12A, 5},
    {46, 0x120, 0x128, 7}, {11, 0x80, 0x88, 7}, {12, 0x80, 0x8A, 5},
};

static const char uno_ports[] = "DDDDDDDDBBBBBBCCCCCC";
static const uint8_t uno_bits[] = {0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5};
static const output_t uno_outputs[] = {
    {6, 0x44, 0x47, 7}, {5, 0x44, 0x48, 5},  {9, 0x80, 0x88, 7},
    {10, 0x80, 0x8A, 5}, {11, 0xB0, 0xB3, 7}, {3, 0xB0, 0xB4, 5},
};

#define COUNT(table) (sizeof table / sizeof *table)
static const map_t maps[] = {
    {"atmega2560", mega_ports, mega_bits, mega_outputs, COUNT(mega_outputs)},
    {"atmega328p", uno_ports, uno_bits, uno_outputs, COUNT(uno_outputs)},
};
static const map_t *map = maps;

void pins_begin(const chip_t *chip)
{
    for (unsigned i = 0; i < COUNT(maps); i++)
        if (!strcmp(maps[i].mcu, chip->mcu))
            map = &maps[i];
}

place_t pin_place(uint8_t pin)
{
    if (pin >= strlen(map->ports))
        return (place_t){'?', 0, 0, 0, 0};
    place_t place = {.port = map->ports[pin], .bit = map->bits[pin]};
    for (unsigned i = 0; i < map->output_count; i++)
        if (map->outputs[i].pin == pin) {
            place.control = map->outputs[i].control;
            place.compare = map->outputs[i].compare;
            place.connect = map->outputs[i].connect;
        }
    return place;
}

uint16_t pin_address(char port)
{
    static const char order[] = "HJKL";
    for (unsigned i = 0; i < 4; i++)
        if (order[i] == port)
            return (uint16_t)(0x100 + 3 * i);
    return (uint16_t)(0x20 + 3 * (port - 'A'));
}

void pins_drive(avr_t *avr, uint8_t pin, uint8_t level)
{
    place_t place = pin_place(pin);
    if (place.port == '?')
        return;
    avr_ioport_t *port = NULL;
    for (avr_io_t *io = avr->io_port; io && !port; io = io->next)
        if (io->kind && !strcmp(io->kind, "port") && ((avr_ioport_t *)io)->name == place.port)
            port = (avr_ioport_t *)io;
    if (!port)
        return;
    uint8_t mask = (uint8_t)(1 << place.bit);
    port->external.pull_mask |= mask;
    port->external.pull_value = (uint8_t)((port->external.pull_value & ~mask) | (level ? mask : 0));
    avr_raise_irq(port->io.irq + place.bit, level);
}
