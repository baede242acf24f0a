/* The firmware's pure parts, built for the host and driven by tests through standard input.

   pure codec           lines of hex bytes of a wire  ->  `frame HEX` or `damaged` for each delimiter
   pure settings        lines of hex payloads         ->  `REFUSAL FIELD`
   pure speed           `gains START GAIN P I SLOTS LAG`, then `command TARGET NOW` or
                        `step NOW EDGES LAST` (ticks) ->  `DUTY STALLED`
   pure pins                                         ->  `PWM INTERRUPT` of each pin from 0 on
   pure fuzz SEED N     N random or half-random inputs to every part; prints `fuzzed N`
   pure damage SEED N   N damaged command frames; prints
                        `wrong W lost_intact L damaged D` */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "board.h"
#include "codec.h"
#include "deadman.h"
#include "settings.h"
#include "speed.h"
#include "storm.h"

#define LINE 4096

static uint64_t random_state;

/* xorshift64*: Vigna, "An experimental exploration of Marsaglia's xorshift generators" (2016) */
static uint64_t random_bits(void)
{
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    return random_state * 0x2545F4914F6CDD1DULL;
}

static double fraction(void)
{
    return (double)(random_bits() >> 11) / 9007199254740992.0;
}

static int bytes_of(const char *line, uint8_t *bytes)
{
    int count = 0;
    unsigned value;
    while (sscanf(line, "%2x", &value) == 1) {
        bytes[count++] = (uint8_t)value;
        line += 2;
    }
    return count;
}

static void codec_lines(void)
{
    static char line[LINE];
    codec_t codec = {0};
    while (fgets(line, sizeof line, stdin)) {
        uint8_t bytes[LINE];
        int count = bytes_of(line, bytes);
        for (int i = 0; i < count; i++) {
            uint8_t result = codec_receive(&codec, bytes[i]);
            if (result == CODEC_DAMAGED)
                puts("damaged");
            if (result != CODEC_FRAME)
                continue;
            printf("frame ");
            for (uint8_t j = 0; j < codec_size(&codec); j++)
                printf("%02x", codec.bytes[1 + j]);
            puts("");
        }
    }
}

static void settings_lines(void)
{
    static char line[LINE];
    while (fgets(line, sizeof line, stdin)) {
        uint8_t bytes[LINE], field = 0;
        if (bytes_of(line, bytes) != sizeof(settings_t))
            exit(1);
        settings_t settings;
        memcpy(&settings, bytes, sizeof settings);
        uint8_t refusal = settings_check(&settings, &field);
        printf("%u %u\n", refusal, field);
    }
}

static void speed_lines(void)
{
    static char line[LINE];
    speed_t speed = {0};
    unsigned slots, lag, count;
    ticks_t now, last;
    int target;
    bool stalled = false;
    while (fgets(line, sizeof line, stdin)) {
        if (sscanf(line, "gains %hd %hd %hd %hd %u %u", &speed.start, &speed.gain,
                   &speed.proportional, &speed.integral, &slots, &lag) == 6) {
            speed.pitch = speed_pitch((uint16_t)slots);
            speed.lag = (uint8_t)lag;
            continue;
        }
        if (sscanf(line, "command %d %u", &target, &now) == 2) {
            speed_command(&speed, (int16_t)target, now);
        } else if (sscanf(line, "step %u %u %u", &now, &count, &last) == 3) {
            speed_edges(&speed, (uint16_t)count, last);
            speed_step(&speed, now);
            stalled = speed_stalled(&speed, false);
        }
        printf("%d %d\n", speed.duty, stalled);
    }
}

static void pins(void)
{
    pin_t pin;
    for (uint8_t number = 0; board_pin(number, &pin); number++)
        printf("%u %u\n", pin.pwm, pin.interrupt);
}

static void fuzz_speed(speed_t *speed, ticks_t *now)
{
    *now += random_bits() % 8 ? 2500 : (ticks_t)random_bits() >> (random_bits() % 32);
    speed->start = (int16_t)(random_bits() % (GAIN_MAXIMUM + 1));
    speed->gain = (int16_t)(random_bits() % (GAIN_MAXIMUM + 1));
    speed->proportional = (int16_t)(random_bits() % (GAIN_MAXIMUM + 1));
    speed->integral = (int16_t)(random_bits() % (GAIN_MAXIMUM + 1));
    speed->pitch = speed_pitch((uint16_t)(1 + random_bits() % 10000));
    speed->lag = (uint8_t)random_bits();
    if (random_bits() % 8 == 0)
        speed_command(speed, (int16_t)random_bits(), *now);
    if (random_bits() & 1)
        speed_edges(speed, (uint16_t)random_bits() >> (random_bits() % 16),
                    *now - (ticks_t)(random_bits() % 5000));
    speed_step(speed, *now);
    if (speed->duty != 0 && (speed->duty < 0) != (speed->target < 0) && !speed->slewing)
        exit(3); /* duty against the target */
    if (speed_stalled(speed, random_bits() & 1))
        speed_stop(speed);
}

/* Any numbers of interrupts and edges: what is admitted between two ticks is bounded. */
static void fuzz_storm(storm_t *storm)
{
    unsigned admitted = 0;
    while (storm_admits(storm))
        if (++admitted > UINT8_MAX)
            exit(6);
    for (unsigned i = random_bits() % 4; i != 0; i--)
        storm_tick(storm);
    storm_check(storm, (uint16_t)random_bits(), (uint16_t)random_bits());
    if (random_bits() % 64 == 0)
        storm_begin(storm, (uint32_t)random_bits() >> (4 + random_bits() % 28));
}

static void fuzz_deadman(deadman_t *deadman, uint32_t *now)
{
    uint8_t link = random_bits() & 1, sequence = random_bits() & 0xF;
    *now += (uint32_t)random_bits() % 100000;
    switch (random_bits() % 8) {
    case 0: deadman_ready(deadman); break;
    case 1: deadman_stop(deadman, link, sequence, *now); break;
    case 2: deadman_hold(deadman, random_bits() & 1 ? MODE_FAULT : MODE_BATTERY); break;
    case 3: deadman_clear(deadman); break;
    case 4: deadman_button(deadman, random_bits() & 1); break;
    default: {
        uint8_t owner = deadman->owner;
        if (deadman_command(deadman, link, MODE_SPEED, sequence, *now) && owner != link)
            exit(4); /* accepted a command of a link that does not own the commands */
    }
    }
    deadman_tick(deadman, 75000, *now);
    if (deadman_drives(deadman) && (deadman->owner == NO_OWNER || *now - deadman->commanded >= 75000))
        exit(5); /* drives although the owner is silent for the timeout */
}

static void fuzz(long count)
{
    codec_t codec = {0};
    speed_t speed = {0};
    storm_t storm;
    deadman_t deadman;
    ticks_t now = 0, speed_now = 0;
    storm_begin(&storm, 0);
    deadman_begin(&deadman);
    for (long i = 0; i < count; i++) {
        uint8_t bytes[64], field;
        for (unsigned j = 0; j < sizeof bytes; j++)
            bytes[j] = random_bits() % 5 == 0 ? (uint8_t)(random_bits() % 8) : (uint8_t)random_bits();
        for (unsigned j = 0; j < sizeof bytes; j++)
            codec_receive(&codec, bytes[j]);
        settings_t settings;
        memcpy(&settings, bytes, sizeof settings);
        settings_check(&settings, &field);
        fuzz_speed(&speed, &speed_now);
        fuzz_storm(&storm);
        fuzz_deadman(&deadman, &now);
    }
    printf("fuzzed %ld\n", count);
}

/* Flips bits of a frame; the distance to the next flip is geometric. At least one is flipped. */
static void damage(uint8_t *wire, unsigned size)
{
    double rate = pow(10.0, -4.0 + 2.0 * fraction()); /* 1e-4 to 1e-2, evenly in the logarithm */
    unsigned bits = 8 * size, first = (unsigned)(fraction() * bits);
    wire[first / 8] ^= (uint8_t)(1 << first % 8);
    for (double at = log(fraction()) / log1p(-rate); at < bits; at += 1 + log(fraction()) / log1p(-rate))
        if ((unsigned)at != first)
            wire[(unsigned)at / 8] ^= (uint8_t)(1 << (unsigned)at % 8);
}

static void damage_frames(long count)
{
    codec_t codec = {0};
    long wrong = 0, lost = 0, damaged = 0;
    for (long i = 0; i < count; i++) {
        command_t frame = {.type = TYPE_COMMAND, .sequence = (uint8_t)(i & 0xF)};
        uint8_t wire[3][WIRE_BYTES(sizeof frame)];
        uint8_t size = 0;
        int accepted = 0;
        frame.left = (int16_t)random_bits();
        frame.right = (int16_t)random_bits();
        for (int copy = 0; copy < 3; copy++)
            size = codec_encode(&frame, sizeof frame, wire[copy]);
        damage(wire[0], size);
        /* A damaged frame, then two intact ones: the second must always arrive. */
        for (int copy = 0; copy < 3; copy++)
            for (uint8_t j = 0; j < size; j++) {
                uint8_t result = codec_receive(&codec, wire[copy][j]);
                damaged += result == CODEC_DAMAGED;
                if (result != CODEC_FRAME)
                    continue;
                wrong += memcmp(codec.bytes + 1, &frame, sizeof frame) != 0;
                accepted |= 1 << copy;
            }
        lost += !(accepted & 4);
    }
    printf("wrong %ld lost_intact %ld damaged %ld\n", wrong, lost, damaged);
}

int main(int count, char **words)
{
    const char *job = count > 1 ? words[1] : "";
    random_state = count > 2 ? 0x9E3779B97F4A7C15ULL ^ strtoull(words[2], NULL, 10) : 1;
    if (!strcmp(job, "codec"))
        codec_lines();
    else if (!strcmp(job, "settings"))
        settings_lines();
    else if (!strcmp(job, "speed"))
        speed_lines();
    else if (!strcmp(job, "pins"))
        pins();
    else if (!strcmp(job, "fuzz") && count > 3)
        fuzz(atol(words[3]));
    else if (!strcmp(job, "damage") && count > 3)
        damage_frames(atol(words[3]));
    else
        return 2;
    return 0;
}
