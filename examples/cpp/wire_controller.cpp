// A force controller that hears estimates over ZeroMQ, such as those of
//   palpate live zmq:tcp://127.0.0.1:5555 --publish 'zmq:tcp://127.0.0.1:5556?format=binary'
// and scales its gain by the stiffness. It says what it does whenever that changes, and why.
//   wire_controller tcp://127.0.0.1:5556 [seconds]
#include <zmq.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>

#include "estimate_packet.hpp"

namespace {

namespace wire = palpate_wire;

constexpr double bandwidth = 10.0;  // 1/s, of the force control on any material
constexpr double oldest = 0.5;      // s: with an older estimate the robot stops
constexpr std::uint32_t faulty = wire::stuck_force | wire::saturation | wire::late_force;

struct Controller {
  double gain = 0.0;  // velocity per force, m/(s·N)
  double stiffness = 0.0;
  std::string action;

  void decide(const char* what, double new_gain, const std::string& why) {
    gain = new_gain;
    const std::string now = std::string(what) + ": " + why;
    if (now != action) std::printf("%s\n", now.c_str());
    std::fflush(stdout);
    action = now;
  }

  // What came from the network, of any size.
  void take(const void* data, std::size_t size) {
    std::uint32_t schema = 0;
    if (size >= sizeof schema) std::memcpy(&schema, data, sizeof schema);
    if (schema != wire::schema) {
      return decide("stop", 0.0,
                    "the message has schema " + std::to_string(schema) +
                        ", this controller reads " + std::to_string(wire::schema));
    }
    if (size < sizeof(wire::Estimate)) return decide("stop", 0.0, "the message is too short");
    wire::Estimate estimate;
    std::memcpy(&estimate, data, sizeof estimate);
    react(estimate);
  }

  void react(const wire::Estimate& estimate) {
    if (estimate.checks & wire::lost_contact) return decide("hold", gain, "lost contact");
    if (estimate.stiffness_mark == wire::do_not_trust || (estimate.checks & faulty)) {
      return decide("stop", 0.0, "do not trust");
    }
    if (!(estimate.age <= oldest)) return decide("stop", 0.0, "the estimate is too old");
    const double now = std::isfinite(estimate.stiffness) ? estimate.stiffness : 0.0;
    const bool usable = estimate.stiffness_usable == 1 && now > 0.0;
    // Too stiff is safe, too soft may oscillate: where it is not usable the gain only falls.
    stiffness = usable ? now : std::max(stiffness, now);
    const double scaled = stiffness > 0.0 ? bandwidth / stiffness : 0.0;
    decide(usable ? "follow" : "hold", scaled, usable ? "usable" : "not usable");
  }
};

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) {
    std::fprintf(stderr, "wire_controller ENDPOINT [SECONDS]\n");
    return 2;
  }
  void* context = zmq_ctx_new();
  void* socket = zmq_socket(context, ZMQ_SUB);
  zmq_setsockopt(socket, ZMQ_SUBSCRIBE, "estimate", 8);
  if (zmq_connect(socket, arguments[1]) != 0) {
    std::fprintf(stderr, "%s: %s\n", arguments[1], zmq_strerror(zmq_errno()));
    return 2;
  }
  using Clock = std::chrono::steady_clock;
  const double seconds =
      count > 2 ? std::atof(arguments[2]) : std::numeric_limits<double>::infinity();
  const auto elapsed = [](Clock::time_point since) {
    return std::chrono::duration<double>(Clock::now() - since).count();
  };
  const Clock::time_point begin = Clock::now();
  Clock::time_point heard = begin;
  Controller controller;
  while (elapsed(begin) < seconds) {
    zmq_pollitem_t item{socket, 0, ZMQ_POLLIN, 0};
    if (zmq_poll(&item, 1, 20) > 0) {  // ms
      // A topic, and the estimate in a second frame; any further frame is ignored.
      for (int frame = 0, more = 1; more != 0; ++frame) {
        zmq_msg_t message;
        zmq_msg_init(&message);
        if (zmq_msg_recv(&message, socket, 0) < 0) break;
        if (frame == 1) controller.take(zmq_msg_data(&message), zmq_msg_size(&message));
        more = zmq_msg_more(&message);
        zmq_msg_close(&message);
      }
      heard = Clock::now();
    } else if (elapsed(heard) > oldest) {
      controller.decide("stop", 0.0, "no estimate arrives");
    }
    // Here your controller moves by controller.gain times the error of its force.
  }
  std::printf("gain %.6g\n", controller.gain);
  zmq_close(socket);
  zmq_ctx_term(context);
  return 0;
}
