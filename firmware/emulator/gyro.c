/* An MPU6050 at its two addresses, an LSM6DSO at its own, as far as the firmware needs them: their registers (register
   map of the MPU6050, revision 4.2; data sheet of the LSM6DSO, which has those of the LSM6DS3 here), and
   the bus unit of the chip, since that of simavr 1.6 loses bytes of a master. */
#include "gyro.h"

#include <simavr/avr_ioport.h>
#include <simavr/avr_twi.h>
#include <string.h>

#include "pins.h"

enum { TWIE = 1, TWEN = 4, TWSTO = 0x10, TWSTA = 0x20, TWEA = 0x40, TWINT = 0x80 };
/* Status of the bus unit (data sheet, tables 24-3 and 24-4). */
enum {
    STARTED = 0x08,
    STARTED_AGAIN = 0x10,
    WRITES = 0x18,
    WRITES_UNANSWERED = 0x20,
    WRITTEN = 0x28,
    READS = 0x40,
    READS_UNANSWERED = 0x48,
    RECEIVED = 0x50,
    RECEIVED_LAST = 0x58,
};
enum { CONFIG = 0x1B, ACCELERATION_CONFIG = 0x1C, ACCELERATION = 0x3B, XOUT = 0x43, POWER = 0x6B, IDENTITY = 0x75 };
#define ASLEEP 0x40
#define LSB_PER_DEGREE 131 /* at 250 deg/s; half of it at each larger scale */
#define UNITS_PER_DEGREE 50
/* The LSM6DSO. Without a rate its gyro is off. With BLOCKS both bytes of a reading are of one rate,
   with INCREMENTS they are successive registers. */
enum { LSM6_ADDRESS = 0x6A, LSM6_IDENTITY = 0x0F, LSM6_ACCELERATION_CONFIG = 0x10, RATE_AND_SCALE = 0x11, CONTROL = 0x12, LSM6_XOUT = 0x22, LSM6_ACCELERATION = 0x28 };
enum { BLOCKS = 0x40, INCREMENTS = 0x04 };
#define RATE_BITS 0xF0
#define RANGE_245_MICRODEGREES 8750 /* of a bit; twice that at each larger scale */
#define UNIT_MICRODEGREES 20000
#define PULSES_TO_RELEASE 9 /* rest of a byte, and its acknowledge */
#define BITS_OF_BYTE 9

static bool is_lsm6(const gyro_t *gyro)
{
    return (gyro->board->options.gyro & ~1u) == LSM6_ADDRESS;
}

static void power_up(gyro_t *gyro)
{
    memset(gyro->registers, 0, sizeof gyro->registers);
    if (is_lsm6(gyro)) {
        gyro->registers[LSM6_IDENTITY] = 0x6C;
        gyro->registers[CONTROL] = INCREMENTS;
        return;
    }
    gyro->registers[POWER] = ASLEEP;
    gyro->registers[IDENTITY] = 0x68;
}

static int16_t saturated(int raw)
{
    return raw > INT16_MAX ? INT16_MAX : raw < INT16_MIN ? INT16_MIN : (int16_t)raw;
}

/* Both measure up to 2 g, unless their full scale is another one, which this does not convert. */
static void latch_acceleration(gyro_t *gyro)
{
    uint8_t number = is_lsm6(gyro) ? LSM6_ACCELERATION : ACCELERATION;
    uint8_t config = gyro->registers[is_lsm6(gyro) ? LSM6_ACCELERATION_CONFIG : ACCELERATION_CONFIG];
    if (config & (is_lsm6(gyro) ? 0x0C : 0x18) || (is_lsm6(gyro) && !(config & RATE_BITS)))
        return;
    for (unsigned axis = 0; axis < 3; axis++) {
        int16_t raw = gyro->accelerations[axis];
        gyro->registers[number + 2 * axis + is_lsm6(gyro)] = (uint8_t)(raw >> 8);
        gyro->registers[number + 2 * axis + !is_lsm6(gyro)] = (uint8_t)raw;
    }
}

static void latch_mpu6050(gyro_t *gyro)
{
    if (gyro->registers[POWER] & ASLEEP)
        return;
    latch_acceleration(gyro);
    int scale = gyro->registers[CONFIG] >> 3 & 3;
    for (unsigned axis = 0; axis < 3; axis++) {
        int16_t raw = saturated(gyro->rates[axis] * LSB_PER_DEGREE / (1 << scale) / UNITS_PER_DEGREE);
        gyro->registers[XOUT + 2 * axis] = (uint8_t)(raw >> 8);
        gyro->registers[XOUT + 2 * axis + 1] = (uint8_t)raw;
    }
}

/* Bytes that could be of two rates are as wrong as can be, so that a test shows them. */
static void latch_lsm6(gyro_t *gyro)
{
    latch_acceleration(gyro);
    uint8_t control = gyro->registers[RATE_AND_SCALE];
    if (!(control & RATE_BITS))
        return;
    int microdegrees = RANGE_245_MICRODEGREES << (control >> 2 & 3);
    for (unsigned axis = 0; axis < 3; axis++) {
        int16_t raw = saturated(gyro->rates[axis] * UNIT_MICRODEGREES / microdegrees);
        if (!(gyro->registers[CONTROL] & BLOCKS))
            raw ^= 0x80;
        gyro->registers[LSM6_XOUT + 2 * axis] = (uint8_t)raw;
        gyro->registers[LSM6_XOUT + 2 * axis + 1] = (uint8_t)(raw >> 8);
    }
}

/* Registers of the rates hold the last values while the gyro is off or stuck. */
static void latch(gyro_t *gyro)
{
    if (gyro->fault == GYRO_STUCK)
        return;
    if (is_lsm6(gyro))
        latch_lsm6(gyro);
    else
        latch_mpu6050(gyro);
}

/* Status after a byte, or after the address. */
static uint8_t exchange(gyro_t *gyro, uint8_t control)
{
    uint8_t *data = &gyro->board->avr->data[gyro->unit->r_twdr];
    bool answers = gyro->fault != GYRO_SILENT;
    switch (gyro->phase) {
    case ADDRESSING:
        gyro->phase = *data & 1 ? READING : POINTING;
        if (*data >> 1 != gyro->board->options.gyro || !answers)
            return *data & 1 ? READS_UNANSWERED : WRITES_UNANSWERED;
        return *data & 1 ? READS : WRITES;
    case POINTING:
        gyro->pointer = *data % GYRO_REGISTERS;
        gyro->phase = WRITING;
        return WRITTEN;
    case WRITING:
        gyro->registers[gyro->pointer] = *data;
        gyro->pointer = (gyro->pointer + 1) % GYRO_REGISTERS;
        return WRITTEN;
    default:
        *data = gyro->registers[gyro->pointer];
        if (!is_lsm6(gyro) || gyro->registers[CONTROL] & INCREMENTS)
            gyro->pointer = (gyro->pointer + 1) % GYRO_REGISTERS;
        return control & TWEA ? RECEIVED : RECEIVED_LAST;
    }
}

static bool held(const gyro_t *gyro)
{
    return gyro->fault == GYRO_BUS_HELD || gyro->fault == GYRO_BUS_IN_READING;
}

static avr_cycle_count_t step_done(avr_t *avr, avr_cycle_count_t when, void *value)
{
    gyro_t *gyro = value;
    uint8_t *control = &avr->data[gyro->unit->r_twcr], status;
    if (held(gyro))
        return when + gyro->bit * BITS_OF_BYTE; /* the bus unit waits for a free bus */
    if (gyro->starts) {
        status = gyro->owned ? STARTED_AGAIN : STARTED;
        gyro->owned = true;
        gyro->phase = ADDRESSING;
    } else {
        status = exchange(gyro, *control);
    }
    avr->data[gyro->unit->r_twsr] = status;
    *control |= TWINT;
    avr_raise_interrupt(avr, &gyro->unit->twi);
    return 0;
}

static void control_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *parameter)
{
    gyro_t *gyro = parameter;
    avr->data[address] = value & (uint8_t)~(TWINT | TWSTO);
    if (!(value & TWEN)) {
        avr_cycle_timer_cancel(avr, step_done, gyro);
        avr_clear_interrupt(avr, &gyro->unit->twi);
        gyro->owned = false;
        return;
    }
    if (!(value & TWINT))
        return;
    avr_clear_interrupt(avr, &gyro->unit->twi);
    avr->data[address] &= (uint8_t)~TWINT;
    if (value & TWSTO) {
        gyro->owned = false;
        return;
    }
    gyro->starts = value & TWSTA;
    gyro->bit = 16 + 2u * avr->data[gyro->unit->r_twbr];
    avr_cycle_timer_cancel(avr, step_done, gyro);
    avr_cycle_timer_register(avr, gyro->bit * (gyro->starts ? 1 : BITS_OF_BYTE), step_done, gyro);
}

static void drive_data(gyro_t *gyro)
{
    pins_drive(gyro->board->avr, gyro->board->options.chip->sda, !held(gyro));
}

/* The chip drives its clock pin low by making it an output. */
static void direction_changed(avr_irq_t *irq, uint32_t value, void *parameter)
{
    gyro_t *gyro = parameter;
    bool low = value >> pin_place(gyro->board->options.chip->scl).bit & 1;
    (void)irq;
    if (low && !gyro->clock_low && ++gyro->pulses == PULSES_TO_RELEASE
        && gyro->fault == GYRO_BUS_IN_READING) {
        gyro->fault = GYRO_WORKS;
        drive_data(gyro);
    }
    gyro->clock_low = low;
}

void gyro_begin(board_t *board)
{
    avr_t *avr = board->avr;
    gyro_t *gyro = &board->gyro;
    if (!board->options.gyro)
        return;
    gyro->board = board;
    for (avr_io_t *io = avr->io_port; io; io = io->next)
        if (io->kind && !strcmp(io->kind, "twi"))
            gyro->unit = (avr_twi_t *)io;
    avr->io[AVR_DATA_TO_IO(gyro->unit->r_twcr)].w.c = control_written;
    avr->io[AVR_DATA_TO_IO(gyro->unit->r_twcr)].w.param = gyro;
    avr->io[AVR_DATA_TO_IO(gyro->unit->r_twdr)].w.c = NULL; /* plain registers */
    avr->io[AVR_DATA_TO_IO(gyro->unit->r_twsr)].w.c = NULL;
    place_t clock = pin_place(board->options.chip->scl);
    avr_irq_t *irq = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(clock.port), IOPORT_IRQ_DIRECTION_ALL);
    if (irq)
        avr_irq_register_notify(irq, direction_changed, gyro);
    power_up(gyro);
}

void gyro_reset(board_t *board, bool power)
{
    if (!board->options.gyro)
        return;
    board->gyro.owned = false;
    if (power)
        power_up(&board->gyro);
    drive_data(&board->gyro);
}

void gyro_set(board_t *board, unsigned input, uint16_t value)
{
    gyro_t *gyro = &board->gyro;
    if (!board->options.gyro)
        return;
    if (input < 3) {
        gyro->rates[input] = (int16_t)value;
        latch(gyro);
        return;
    }
    if (input >= GYRO_ACCELERATIONS) {
        gyro->accelerations[input - GYRO_ACCELERATIONS] = (int16_t)value;
        latch(gyro);
        return;
    }
    if (value == gyro->input)
        return;
    gyro->input = gyro->fault = (uint8_t)value;
    gyro->pulses = 0;
    if (gyro->fault == GYRO_SUPPLY_DIP) {
        power_up(gyro);
        if (!is_lsm6(gyro))
            gyro->registers[POWER] = 0; /* an MPU6500 does not sleep after it */
    }
    drive_data(gyro);
}
