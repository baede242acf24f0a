/* An Arduino Mega 2560, Uno or Nano on simavr: runs a real image in lockstep with requests on standard
   input, or paced to real time, with its UARTs as messages or as pseudo-terminals.

   emulator [--chip NAME] [--hex FILE] [--boot FILE] [--eeprom FILE] [--pty] [--paced] [--motor EN,IN1,IN2,STANDBY,SHORTS]...
            [--sonar TRIGGER,ECHO]... [--gyro ADDRESS]

   Requests (little-endian), one reply each:
     'S' u64 until_ns, u16 transitions, u16 analogs, u16 bytes0, u16 bytes1, then
         transitions of (u32 ns since the last step's end, u8 pin, u8 level),
         analogs of (u8 channel, u16 millivolts; from channel 128 on HC-SR04 sensors, us of their
         echoes, 0: it does not answer, 65535: it does not end; from channel 160 on the inputs of
         the gyro), bytes for UART0, bytes for UART1
     reply: u64 now_ns, u16 motor events, u16 bytes, u8 flags (1: reset, 2: crashed), then
         events of (u32 ns since the step began, u8 motor, i16 duty of 32767, i16 share
            of a pulse for which its driver shorts it),
         bytes of (u32 ns since the step began, at its stop bit, u8 uart, u8 byte)
     'R' u8 MCUSR bits: reset.    'H': the program hangs from now on.
     'Q': reply 4096 bytes of EEPROM.    'W' 4096 bytes: set the EEPROM.
     'P' u8 pin, u32 ns high, u32 ns low, u32 ns of random addition to each: pulses at a pin from now
         on, without requests for each of them; all 0 ends them.
     'F' u32 offset, u32 length: reply the flash.    'D': reply u32 writes to unerased flash.
   'R', 'H', 'W', 'P' are replied to with one zero byte. */
#define _GNU_SOURCE
#include "board.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "gyro.h"
#include "lines.h"
#include "sonars.h"

#define PACE_NS 1000000            /* step of real time when paced */
#define FIRST_SONAR 128
#define FIRST_GYRO 160

static const chip_t chips[] = {
    {.mcu = "atmega2560", .uarts = 2, .eeprom_size = 4096, .page = 256, .hang = 0x3DFFE,
     .sda = 20, .scl = 21},
    {.mcu = "atmega328p", .uarts = 1, .eeprom_size = 1024, .page = 128, .hang = 0x77FE,
     .sda = 18, .scl = 19},
};

static board_t board;

static bool read_all(void *to, size_t size)
{
    uint8_t *at = to;
    while (size) {
        ssize_t got = read(STDIN_FILENO, at, size);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return false;
        at += got;
        size -= (size_t)got;
    }
    return true;
}

static void write_all(const void *from, size_t size)
{
    const uint8_t *at = from;
    while (size) {
        ssize_t put = write(STDOUT_FILENO, at, size);
        if (put < 0 && errno == EINTR)
            continue;
        if (put <= 0)
            exit(1); /* the reader has gone */
        at += put;
        size -= (size_t)put;
    }
}

static void put(uint8_t **at, uint64_t value, unsigned size)
{
    for (unsigned i = 0; i < size; i++)
        *(*at)++ = (uint8_t)(value >> 8 * i);
}

static void answer_step(uint64_t began)
{
    static uint8_t out[16 + 9 * EVENTS + 6 * BYTES];
    uint8_t *at = out;
    put(&at, board_now(&board), 8);
    put(&at, board.event_count, 2);
    put(&at, board.byte_count, 2);
    put(&at, board.flags, 1);
    for (unsigned i = 0; i < board.event_count; i++) {
        const event_t *event = &board.events[i];
        put(&at, event->time - began, 4);
        put(&at, event->motor, 1);
        put(&at, (uint16_t)event->duty, 2);
        put(&at, (uint16_t)event->shorted, 2);
    }
    for (unsigned i = 0; i < board.byte_count; i++) {
        put(&at, board.bytes[i].time - began, 4);
        put(&at, board.bytes[i].uart, 1);
        put(&at, board.bytes[i].byte, 1);
    }
    board.event_count = board.byte_count = board.flags = 0;
    write_all(out, (size_t)(at - out));
}

static bool step(void)
{
    struct __attribute__((packed)) {
        uint64_t until;
        uint16_t transitions, analogs, bytes[2];
    } head;
    if (!read_all(&head, sizeof head))
        return false;
    uint64_t began = board_now(&board);
    for (unsigned i = 0; i < head.transitions; i++) {
        struct __attribute__((packed)) {
            uint32_t after;
            uint8_t pin, level;
        } change;
        if (!read_all(&change, sizeof change))
            return false;
        board_transition(&board, began + change.after, change.pin, change.level);
    }
    for (unsigned i = 0; i < head.analogs; i++) {
        struct __attribute__((packed)) {
            uint8_t channel;
            uint16_t millivolts;
        } analog;
        if (!read_all(&analog, sizeof analog))
            return false;
        if (analog.channel >= FIRST_GYRO)
            gyro_set(&board, analog.channel - FIRST_GYRO, analog.millivolts);
        else if (analog.channel >= FIRST_SONAR)
            sonars_set(&board, analog.channel - FIRST_SONAR, analog.millivolts);
        else
            board_analog(&board, analog.channel, analog.millivolts);
    }
    for (unsigned uart = 0; uart < UARTS; uart++) {
        uint8_t bytes[UINT16_MAX];
        if (!read_all(bytes, head.bytes[uart]))
            return false;
        if (uart < board.options.chip->uarts)
            lines_receive(&board, uart, bytes, head.bytes[uart]);
    }
    board_run(&board, head.until);
    answer_step(began);
    return true;
}

static bool pulses(void)
{
    struct __attribute__((packed)) {
        uint8_t pin;
        uint32_t high, low, jitter;
    } train;
    return read_all(&train, sizeof train)
        && board_pulses(&board, train.pin, train.high, train.low, train.jitter);
}

static bool answer_flash(void)
{
    uint32_t place[2];
    if (!read_all(place, sizeof place))
        return false;
    if (place[0] > board.avr->flashend || place[1] > board.avr->flashend + 1 - place[0])
        return false;
    write_all(board.avr->flash + place[0], place[1]);
    return true;
}

static bool handle_request(void)
{
    uint8_t request, cause;
    uint8_t eeprom[EEPROM_SIZE];
    if (!read_all(&request, 1))
        return false;
    switch (request) {
    case 'S':
        return step();
    case 'R':
        if (!read_all(&cause, 1))
            return false;
        board_reset(&board, cause);
        break;
    case 'H':
        board_hang(&board);
        break;
    case 'Q':
        board_eeprom_get(&board, eeprom);
        write_all(eeprom, sizeof eeprom);
        return true;
    case 'W':
        if (!read_all(eeprom, sizeof eeprom))
            return false;
        board_eeprom_set(&board, eeprom);
        break;
    case 'P':
        if (!pulses())
            return false;
        break;
    case 'F':
        return answer_flash();
    case 'D':
        write_all(&board.dirty_writes, sizeof board.dirty_writes);
        return true;
    default:
        return false;
    }
    write_all("", 1);
    return true;
}

static uint64_t monotonic(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

/* Without a simulated robot: board time follows real time. Standard input takes all requests but
   'S'. */
static void run_paced(void)
{
    uint64_t start = monotonic() - board_now(&board);
    struct pollfd input = {.fd = STDIN_FILENO, .events = POLLIN};
    for (;;) {
        uint64_t target = board_now(&board) + PACE_NS;
        uint64_t now = monotonic() - start;
        if (now < target) {
            struct timespec wait = {0, (long)(target - now)};
            if (ppoll(&input, 1, &wait, NULL) > 0 && !handle_request())
                return;
        }
        board_run(&board, target);
        board.event_count = board.byte_count = 0;
    }
}

/* The chip called `name`, or null. */
static const chip_t *chip_named(const char *name)
{
    for (unsigned i = 0; i < sizeof chips / sizeof *chips; i++)
        if (!strcmp(chips[i].mcu, name))
            return &chips[i];
    return NULL;
}

static void usage(void)
{
    fprintf(stderr, "emulator [--chip NAME] [--hex FILE] [--boot FILE] [--eeprom FILE] [--pty] [--paced] "
                    "[--motor EN,IN1,IN2,STANDBY,SHORTS]... [--sonar TRIGGER,ECHO]... "
                    "[--gyro ADDRESS]\n");
    exit(2);
}

int main(int count, char **words)
{
    options_t options = {.chip = chips};
    bool paced = false;
    for (int i = 1; i < count; i++) {
        const char *value = i + 1 < count ? words[i + 1] : NULL;
        if (!strcmp(words[i], "--pty")) {
            options.pty = true;
            continue;
        }
        if (!strcmp(words[i], "--paced")) {
            paced = true;
            continue;
        }
        if (!value)
            usage();
        i++;
        if (!strcmp(words[i - 1], "--chip") && chip_named(value))
            options.chip = chip_named(value);
        else if (!strcmp(words[i - 1], "--hex"))
            options.hex = value;
        else if (!strcmp(words[i - 1], "--boot"))
            options.boot = value;
        else if (!strcmp(words[i - 1], "--eeprom"))
            options.eeprom = value;
        else if (!strcmp(words[i - 1], "--motor") && options.motors < MOTORS
                 && sscanf(value, "%hhu,%hhu,%hhu,%hhu,%hhu", &options.motor[options.motors][0],
                           &options.motor[options.motors][1], &options.motor[options.motors][2],
                           &options.motor[options.motors][3], &options.motor[options.motors][4]) == 5)
            options.motors++;
        else if (!strcmp(words[i - 1], "--sonar") && options.sonars < SONARS
                 && sscanf(value, "%hhu,%hhu", &options.sonar[options.sonars][0],
                           &options.sonar[options.sonars][1]) == 2)
            options.sonars++;
        else if (!strcmp(words[i - 1], "--gyro") && sscanf(value, "%u", &options.gyro) == 1)
            continue;
        else
            usage();
    }
    board_begin(&board, &options);
    if (options.pty) {
        for (unsigned uart = 0; uart < options.chip->uarts; uart++)
            printf("%s%c", board.uarts[uart].name, uart + 1 < options.chip->uarts ? ' ' : '\n');
        fflush(stdout);
    }
    if (paced)
        run_paced();
    else
        while (handle_request())
            ;
    board_end(&board);
    return 0;
}
