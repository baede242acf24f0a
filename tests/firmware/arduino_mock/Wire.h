/* Imitation of the library Wire, with the device whose registers the script sets. */
#ifndef WIRE_H
#define WIRE_H

#include <stddef.h>
#include <stdint.h>

class TwoWire {
public:
    bool begin(int sda, int scl, uint32_t frequency);
    bool end(void);
    void setTimeOut(uint16_t ms);
    void beginTransmission(uint8_t address);
    size_t write(uint8_t byte);
    uint8_t endTransmission(bool stop = true);
    size_t requestFrom(uint8_t address, uint8_t size);
    int read(void);
};
extern TwoWire Wire;

#endif
