/* The imitated core, driven by a script on standard input; each line begins with a time in us:

     TIME serial HEX          bytes that arrive
     TIME pin NUMBER LEVEL    level at an input
     TIME millivolts NUMBER V voltage at an input
     TIME device ADDRESS      the I2C device answers there; 0: it does not
     TIME register NUMBER V   content of a register of it
     TIME end

   Prints `TIME sent HEX`, `TIME duty PIN VALUE`, `TIME level PIN VALUE`, `TIME saved HEX`, `TIME bauds N`. */
#include <Arduino.h>
#include <EEPROM.h>
#include <Wire.h>
#include <esp_system.h>
#include <esp_timer.h>

#include <deque>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

static const int PINS = 40, STORE = 257;

struct Event {
    int64_t time;
    std::string what, first;
    int second;
};

static std::deque<Event> script;
static int64_t now;
static std::deque<uint8_t> received;
static int levels[PINS], duties[PINS], millivolts[PINS];
static bool is_driven[PINS]; /* by the script */
static struct {
    void (*handler)(void *);
    void *argument;
} interrupts[PINS];
static void (*timer_handler)(void);
static bool timer_runs, masked;
static uint8_t store[STORE], committed[STORE], registers[256];
static int device, addressed;
static std::vector<uint8_t> written;
static std::deque<uint8_t> to_read;
HardwareSerial Serial;
EEPROMClass EEPROM;
TwoWire Wire;

static void refuse(const char *why)
{
    std::cout << now << " refused " << why << std::endl;
    exit(1);
}

static std::ostream &print(const char *what)
{
    return std::cout << now << " " << what << " ";
}

static std::string hex(const uint8_t *bytes, size_t size)
{
    static const char digits[] = "0123456789abcdef";
    std::string text;
    for (size_t i = 0; i < size; i++)
        text += std::string() + digits[bytes[i] >> 4] + digits[bytes[i] & 15];
    return text;
}

static void happen(const Event &event)
{
    int number = event.what == "serial" || event.what == "end" ? 0 : std::stoi(event.first);
    if (event.what == "serial")
        for (size_t i = 0; i + 1 < event.first.size(); i += 2)
            received.push_back((uint8_t)std::stoi(event.first.substr(i, 2), nullptr, 16));
    else if (event.what == "millivolts")
        millivolts[number] = event.second;
    else if (event.what == "device")
        device = number;
    else if (event.what == "register")
        registers[number] = (uint8_t)event.second;
    else if (event.what == "end")
        exit(0);
    else {
        is_driven[number] = true;
        if (levels[number] == event.second)
            return;
        levels[number] = event.second;
        if (interrupts[number].handler)
            interrupts[number].handler(interrupts[number].argument);
    }
}

void delay(uint32_t ms)
{
    if (masked)
        refuse("waits with interrupts off");
    int64_t until = now + 1000 * (int64_t)ms;
    while (now < until) {
        int64_t next = (now / 1000 + 1) * 1000;
        while (!script.empty() && script.front().time <= next) {
            Event event = script.front();
            script.pop_front();
            now = event.time > now ? event.time : now;
            happen(event);
        }
        now = next;
        if (timer_runs)
            timer_handler();
    }
}

unsigned long millis(void) { return (unsigned long)(now / 1000); }
int64_t esp_timer_get_time(void) { return now++; } /* so that a loop that waits for a time ends */
esp_reset_reason_t esp_reset_reason(void) { return ESP_RST_POWERON; }
unsigned uxTaskGetStackHighWaterMark(void *) { return 4000; }

uint32_t mock_mask(void)
{
    uint32_t before = masked;
    masked = true;
    return before;
}

void mock_unmask(uint32_t state) { masked = state; }

void pinMode(uint8_t pin, uint8_t mode)
{
    if (mode == INPUT_PULLUP && !is_driven[pin])
        levels[pin] = 1;
}

void digitalWrite(uint8_t pin, uint8_t level)
{
    if (levels[pin] != level)
        print("level") << (int)pin << " " << (int)level << std::endl;
    levels[pin] = level;
}

int digitalRead(uint8_t pin) { return levels[pin]; }

void analogWrite(uint8_t pin, int duty)
{
    if (duties[pin] != duty)
        print("duty") << (int)pin << " " << duty << std::endl;
    duties[pin] = duty;
}

uint32_t analogReadMilliVolts(uint8_t pin) { return (uint32_t)millivolts[pin]; }

void attachInterruptArg(uint8_t pin, void (*handler)(void *), void *argument, int)
{
    if (masked)
        refuse("attaches an interrupt with interrupts off");
    interrupts[pin] = {handler, argument};
}

void detachInterrupt(uint8_t pin)
{
    if (masked)
        refuse("detaches an interrupt with interrupts off");
    interrupts[pin] = {nullptr, nullptr};
}

hw_timer_t *timerBegin(uint32_t) { return nullptr; }
void timerAttachInterrupt(hw_timer_t *, void (*handler)(void)) { timer_handler = handler; }
void timerAlarm(hw_timer_t *, uint64_t, bool, uint64_t) { timer_runs = true; }

void HardwareSerial::begin(unsigned long baud) { print("bauds") << baud << std::endl; }
void HardwareSerial::updateBaudRate(unsigned long baud) { print("bauds") << baud << std::endl; }
int HardwareSerial::available(void) { return (int)received.size(); }
int HardwareSerial::availableForWrite(void) { return 128; }

int HardwareSerial::read(void)
{
    uint8_t byte = received.front();
    received.pop_front();
    return byte;
}

size_t HardwareSerial::write(uint8_t byte)
{
    print("sent") << hex(&byte, 1) << std::endl;
    return 1;
}

bool EEPROMClass::begin(size_t size)
{
    for (size_t i = 0; i < size; i++)
        store[i] = 0xFF;
    return size == STORE;
}

uint8_t EEPROMClass::read(int address) { return store[address]; }
void EEPROMClass::write(int address, uint8_t byte) { store[address] = byte; }

bool EEPROMClass::commit(void)
{
    for (int i = 0; i < STORE; i++)
        committed[i] = store[i];
    print("saved") << hex(committed, STORE) << std::endl;
    return true;
}

bool TwoWire::begin(int, int, uint32_t) { return true; }
bool TwoWire::end(void) { return true; }
void TwoWire::setTimeOut(uint16_t) {}

void TwoWire::beginTransmission(uint8_t address)
{
    addressed = address;
    written.clear();
}

size_t TwoWire::write(uint8_t byte)
{
    written.push_back(byte);
    return 1;
}

uint8_t TwoWire::endTransmission(bool)
{
    if (addressed != device)
        return 2;
    if (written.size() == 2)
        registers[written[0]] = written[1];
    return 0;
}

size_t TwoWire::requestFrom(uint8_t address, uint8_t size)
{
    to_read.clear();
    if (address != device)
        return 0;
    for (uint8_t i = 0; i < size; i++)
        to_read.push_back(registers[(uint8_t)(written[0] + i)]);
    return size;
}

int TwoWire::read(void)
{
    uint8_t byte = to_read.front();
    to_read.pop_front();
    return byte;
}

void setup(void);
void loop(void);

int main(void)
{
    std::string line;
    while (std::getline(std::cin, line)) {
        std::istringstream words(line);
        Event event = {0, "", "", 0};
        words >> event.time >> event.what >> event.first >> event.second;
        script.push_back(event);
    }
    setup();
    for (;;)
        loop();
}
