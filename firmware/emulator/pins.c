#include "pins.h"

/* Port and bit of each Arduino pin, from the published pin map of the Mega 2560. */
static const char ports[70] = "EEEEGEHHHHBBBBJJHHDDDDAAAAAAAACCCCCCCCDGGGLLLLLLLLBBBBFFFFFFFFKKKKKKKK";
static const uint8_t bits[70] = {0, 1, 4, 5, 5, 3, 3, 4, 5, 6, 4, 5, 6, 7, 1, 0, 1, 0, 3, 2, 1, 0, 0, 1,
                                 2, 3, 4, 5, 6, 7, 7, 6, 5, 4, 3, 2, 1, 0, 7, 2, 1, 0, 7, 6, 5, 4, 3, 2,
                                 1, 0, 3, 2, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7};

/* Pin, TCCRnA, OCRnx, bit COMnx1. */
static const struct {
    uint8_t pin;
    uint16_t control, compare;
    uint8_t connect;
} outputs[] = {
    {2, 0x90, 0x9A, 5},  {3, 0x90, 0x9C, 3},   {5, 0x90, 0x98, 7},    {6, 0xA0, 0xA8, 7},
    {7, 0xA0, 0xAA, 5},  {8, 0xA0, 0xAC, 3},   {9, 0xB0, 0xB4, 5},    {10, 0xB0, 0xB3, 7},
    {4, 0x44, 0x48, 5},  {13, 0x44, 0x47, 7},  {44, 0x120, 0x12C, 3}, {45, 0x120, 0x12A, 5},
    {46, 0x120, 0x128, 7}, {11, 0x80, 0x88, 7}, {12, 0x80, 0x8A, 5},
};

place_t pin_place(uint8_t pin)
{
    if (pin >= sizeof bits)
        return (place_t){'?', 0, 0, 0, 0};
    place_t place = {.port = ports[pin], .bit = bits[pin]};
    for (unsigned i = 0; i < sizeof outputs / sizeof *outputs; i++)
        if (outputs[i].pin == pin) {
            place.control = outputs[i].control;
            place.compare = outputs[i].compare;
            place.connect = outputs[i].connect;
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
