#include "diffbot_program.h"

int main() {
    static char line[DIFFBOT_LINE];
    double number, sum = 0.0;
    while (diffbot_read(line, sizeof line)) {
        if (diffbot_is(line, "number") && diffbot_number(line, "data", &number)) {
            sum += number;
            diffbot_publish("{\"total\": {\"data\": %.17g}}", sum);
        }
    }
    return 0;
}
