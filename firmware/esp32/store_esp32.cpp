/* Settings and I2C bus of an ESP32, by the libraries EEPROM and Wire of its Arduino core. Never run on a
   chip. */
extern "C" {
#include "board.h"
#include "two_wire.h"
}
#include <Arduino.h>
#include <EEPROM.h>
#include <Wire.h>

#include "esp32.h"

#define BYTES (2 * BOARD_STORE_SLOT + 1) /* two slots, and the number of power-ups */
#define ERASED 0xFF
#define QUIET_MS 5 /* after the last byte of a slot */
#define BUS_TIMEOUT_MS 3 /* shorter than the period of the gyro */
#define BUS_RATE 100000

static bool changed, bus_on;
static uint32_t changed_ms;
static uint8_t bytes[TWO_WIRE_BYTES], state;

void esp32_begin(void)
{
    EEPROM.begin(BYTES);
}

/* The library replaces all bytes at once, or none: a cut of the supply leaves the former ones. */
void esp32_save(void)
{
    if (!changed || millis() - changed_ms < QUIET_MS)
        return;
    changed = false;
    EEPROM.commit();
}

extern "C" {

void board_store_read(uint16_t address, void *to, uint8_t size)
{
    for (uint8_t *at = (uint8_t *)to; size--; address++)
        *at++ = EEPROM.read(address);
}

bool board_store_ready(void)
{
    return true;
}

void board_store_write(uint16_t address, uint8_t byte)
{
    EEPROM.write(address, byte);
    changed = true;
    changed_ms = millis();
}

void board_store_clear(uint16_t slot)
{
    board_store_write(slot, ERASED);
}

void board_two_wire_release(void)
{
    if (bus_on)
        Wire.end();
    bus_on = false;
}

static bool transfer(uint8_t address, uint8_t number, uint8_t value)
{
    Wire.beginTransmission(address);
    Wire.write(number);
    if (value != WIRE_READS) {
        Wire.write(value);
        return Wire.endTransmission() == 0;
    }
    if (Wire.endTransmission(false) != 0 || Wire.requestFrom(address, (uint8_t)TWO_WIRE_BYTES) != TWO_WIRE_BYTES)
        return false;
    for (uint8_t i = 0; i < TWO_WIRE_BYTES; i++)
        bytes[i] = (uint8_t)Wire.read();
    return true;
}

/* Waits for its end, 0.6 ms. */
void two_wire_begin(uint8_t address, uint8_t number, uint8_t value)
{
    if (!bus_on) {
        Wire.begin(board_sda, board_scl, BUS_RATE);
        Wire.setTimeOut(BUS_TIMEOUT_MS);
        bus_on = true;
    }
    state = transfer(address, number, value) ? TWO_WIRE_DONE : TWO_WIRE_FAILED;
}

uint8_t two_wire_state(void)
{
    return state;
}

const volatile uint8_t *two_wire_bytes(void)
{
    return bytes;
}
}
