// A robot on eProsima Fast DDS, which ROS 2 uses by default: publishes poses and wrenches, and hears
// estimates. Arguments: domain, samples, messages that are none. On this machine only.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <mutex>
#include <random>
#include <string>
#include <thread>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>

#include "ProbePubSubTypes.h"

namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using diagnostic_msgs::msg::dds_::DiagnosticArray_;
using diagnostic_msgs::msg::dds_::DiagnosticArray_PubSubType;
using geometry_msgs::msg::dds_::PoseStamped_;
using geometry_msgs::msg::dds_::PoseStamped_PubSubType;
using geometry_msgs::msg::dds_::WrenchStamped_;
using geometry_msgs::msg::dds_::WrenchStamped_PubSubType;
using palpate_msgs::msg::dds_::ContactEstimate_;
using palpate_msgs::msg::dds_::ContactEstimate_PubSubType;

std::atomic<bool> junk{false};

// A pose, or bytes that begin as plain CDR and are no pose.
class PoseOrJunk : public PoseStamped_PubSubType {
 public:
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    if (!junk) return PoseStamped_PubSubType::serialize(data, payload);
    payload->length = 4 + random_() % 60;
    for (unsigned k = 4; k < payload->length; ++k) payload->data[k] = random_() % 256;
    std::memcpy(payload->data, "\0\1\0\0", 4);
    return true;
  }

 private:
  std::minstd_rand random_{7};
};

template <typename Message>
class Heard : public fast::DataReaderListener {
 public:
  void on_data_available(fast::DataReader* reader) override {
    fast::SampleInfo info;
    Message message;
    while (reader->take_next_sample(&message, &info) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      std::lock_guard<std::mutex> guard(mutex);
      last = message;
      ++count;
    }
  }
  std::mutex mutex;
  Message last;
  long count = 0;
};

template <typename Header>
void stamp(Header& header, long k) {
  header.stamp().sec(1700000000 + static_cast<int>(k / 1000));
  header.stamp().nanosec(static_cast<unsigned>(k % 1000) * 1000000u);
  header.frame_id("base");
}

int main(int, char** argv) {
  const int domain = std::atoi(argv[1]);
  const long count = std::atol(argv[2]), refused = std::atol(argv[3]);

  fast::DomainParticipantQos qos = fast::PARTICIPANT_QOS_DEFAULT;
  auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  loopback->interfaceWhiteList = {"127.0.0.1"};
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(loopback);
  for (int member = 0; member < 10; ++member) {
    rtps::Locator_t peer;
    peer.kind = LOCATOR_KIND_UDPv4;
    rtps::IPLocator::setIPv4(peer, 127, 0, 0, 1);
    peer.port = 7410 + 250 * domain + 2 * member;
    qos.wire_protocol().builtin.initialPeersList.push_back(peer);
  }
  auto* participant = fast::DomainParticipantFactory::get_instance()->create_participant(domain, qos);
  if (participant == nullptr) return 1;

  const auto topic = [&](const char* name, fast::TypeSupport type) {
    type.register_type(participant);
    return participant->create_topic(name, type.get_type_name(), fast::TOPIC_QOS_DEFAULT);
  };
  auto* publisher = participant->create_publisher(fast::PUBLISHER_QOS_DEFAULT);
  fast::DataWriterQos writing = fast::DATAWRITER_QOS_DEFAULT;
  writing.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
  writing.history().kind = fast::KEEP_LAST_HISTORY_QOS;
  writing.history().depth = 1000;
  auto* poses = publisher->create_datawriter(
      topic("rt/pose", fast::TypeSupport(new PoseOrJunk)), writing);
  auto* wrenches = publisher->create_datawriter(
      topic("rt/wrench", fast::TypeSupport(new WrenchStamped_PubSubType)), writing);

  auto* subscriber = participant->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
  fast::DataReaderQos reading = fast::DATAREADER_QOS_DEFAULT;
  reading.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
  reading.history().depth = 1000;
  Heard<ContactEstimate_> estimates;
  Heard<DiagnosticArray_> status;
  subscriber->create_datareader(
      topic("rt/palpate/estimate", fast::TypeSupport(new ContactEstimate_PubSubType)), reading,
      &estimates);
  subscriber->create_datareader(
      topic("rt/palpate/status", fast::TypeSupport(new DiagnosticArray_PubSubType)), reading, &status);

  std::string line;
  std::getline(std::cin, line);  // until everybody is there
  PoseStamped_ pose;
  WrenchStamped_ wrench;
  const auto begin = std::chrono::steady_clock::now();
  for (long k = 0; k < count; ++k) {
    std::this_thread::sleep_until(begin + std::chrono::milliseconds(k));
    const double depth = 1e-3 * (k % 200) / 100.0;
    stamp(pose.header(), k);
    stamp(wrench.header(), k);
    pose.pose().position().z(-depth);
    wrench.wrench().force().z(-500.0 * depth);
    poses->write(&pose);
    wrenches->write(&wrench);
    junk = true;
    for (long j = refused * k / count; j < refused * (k + 1) / count; ++j) poses->write(&pose);
    junk = false;
  }
  std::getline(std::cin, line);  // until all has been taken
  {
    std::lock_guard<std::mutex> guard(estimates.mutex);
    const ContactEstimate_& last = estimates.last;
    std::printf("%ld %u %.17g", estimates.count, last.schema(), last.time());
    for (double each : last.parameters()) std::printf(" %.17g", each);
    std::printf("\n%s\n", last.parameter_names().c_str());
  }
  std::lock_guard<std::mutex> guard(status.mutex);
  std::printf("%ld", status.count);
  for (const auto& each : status.last.status())
    std::printf(" %s", each.name().c_str());
  std::printf("\n");
  std::fflush(stdout);
  std::_Exit(0);
}
