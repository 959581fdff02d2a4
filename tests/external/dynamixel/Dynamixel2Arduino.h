// What the sketches use of the public interface of ROBOTIS' library Dynamixel2Arduino, written anew from its
// documentation so that they can be compiled where the library is not installed. It moves nothing: that a sketch compiles
// against it says that names and types are right, not that a servo answers.
#pragma once
#include <Arduino.h>

enum OperatingMode : uint8_t { OP_POSITION = 0, OP_EXTENDED_POSITION, OP_VELOCITY = 4 };
enum ParamUnit : uint8_t { UNIT_RAW = 0, UNIT_PERCENT, UNIT_RPM, UNIT_DEGREE };

class Dynamixel2Arduino {
 public:
  Dynamixel2Arduino(HardwareSerial &port, int dir_pin = -1);
  void begin(unsigned long baud = 57600);
  bool setPortProtocolVersion(float version);
  bool ping(uint8_t id);
  bool torqueOn(uint8_t id);
  bool torqueOff(uint8_t id);
  bool setOperatingMode(uint8_t id, uint8_t mode);
  bool setGoalPosition(uint8_t id, float value, uint8_t unit = UNIT_RAW);
  float getPresentPosition(uint8_t id, uint8_t unit = UNIT_RAW);
};
