/* Imitation of the library EEPROM: what is written is kept when it is committed. */
#ifndef EEPROM_H
#define EEPROM_H

#include <stddef.h>
#include <stdint.h>

class EEPROMClass {
public:
    bool begin(size_t size);
    uint8_t read(int address);
    void write(int address, uint8_t byte);
    bool commit(void);
};
extern EEPROMClass EEPROM;

#endif
